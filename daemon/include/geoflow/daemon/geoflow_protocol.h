/* Records of geoflowd's pose socket, protocol version 1.2. For C11 and C++; needs nothing but this
 * file.
 *
 * Connect to the socket (AF_UNIX, SOCK_SEQPACKET), send one HELLO, receive one WELCOME or REFUSE,
 * then POSE records as they come. One recv() returns one record: a header, then `payload_len`
 * bytes. All numbers are little-endian; all structs are naturally aligned without padding.
 * docs/protocol.md has the tables and the rule by which records grow: copy min(payload_len, sizeof
 * your struct), zero the rest, ignore types that you do not know. */
#ifndef GEOFLOW_PROTOCOL_H
#define GEOFLOW_PROTOCOL_H

/* NOLINTBEGIN(modernize-*,readability-*): C's names, and its only constants for #if; sizes and
 * offsets below are docs/protocol.md's */
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define GEOFLOW_STATIC_ASSERT static_assert
#else
#define GEOFLOW_STATIC_ASSERT _Static_assert
#endif

#define GEOFLOW_MAGIC 0x574F4C46u /* the bytes "FLOW" */
#define GEOFLOW_PROTOCOL_MAJOR 1u /* grows when a reader of the old version would be wrong */
#define GEOFLOW_PROTOCOL_MINOR 2u /* grows when fields or records are added */
#define GEOFLOW_MAX_RECORD 4096u  /* no record, header included, is larger */

enum geoflow_record_type {
  GEOFLOW_HELLO = 1,   /* client to daemon, first and once */
  GEOFLOW_WELCOME = 2, /* daemon to client: accepted */
  GEOFLOW_REFUSE = 3,  /* daemon to client: not accepted; it then closes */
  GEOFLOW_POSE = 4,    /* daemon to client: one estimate */
  GEOFLOW_END = 5,     /* daemon to client: no pose will follow; it then closes */
  /* since 1.2, to clients that want frames */
  GEOFLOW_RING = 6, /* daemon to client, with a descriptor: memory that frames will be in */
  GEOFLOW_FRAME = 7 /* daemon to client: a frame is there */
};

/* 24 bytes before every payload. */
struct geoflow_header {
  uint32_t magic;       /* GEOFLOW_MAGIC */
  uint8_t major;        /* of the sender */
  uint8_t minor;        /* of the sender */
  uint16_t type;        /* enum geoflow_record_type */
  uint32_t payload_len; /* bytes that follow */
  uint32_t
      dropped; /* records of this type that this client missed since the last one, for being slow */
  uint64_t sequence; /* counts records sent to this client from 0 */
};

enum geoflow_want {
  GEOFLOW_WANT_POSE = 1,       /* one pose a frame */
  GEOFLOW_WANT_PROPAGATED = 2, /* since 1.1: one an IMU sample, carried on from the newest frame;
                                  a frame's own only while it is newer than those */
  /* since 1.2 */
  GEOFLOW_WANT_COLOR = 4, /* images of the colour camera, as the estimator sees them: gray */
  GEOFLOW_WANT_DEPTH = 8, /* depth images, registered to the colour camera */
  GEOFLOW_WANT_CLOUD =
      16 /* the map's surfaces: the newest at once, another one when it has changed */
};

struct geoflow_hello {
  uint8_t client_major; /* GEOFLOW_PROTOCOL_MAJOR of the client */
  uint8_t client_minor;
  uint16_t reserved;
  uint32_t want;      /* enum geoflow_want, or-ed */
  double max_rate_hz; /* poses a second at most, and frames of each stream; 0 = every one */
  char name[32];      /* for logs; UTF-8, zero-filled */
};

enum geoflow_clock_flags {
  GEOFLOW_CLOCK_REPLAY = 1, /* poses are of a recording: t_recording_ns is its own time line */
  GEOFLOW_CLOCK_UNPACED =
      2 /* and not at its pace: t_capture_ns and t_arrival_ns are on that time line too */
};

struct geoflow_welcome {
  uint8_t major; /* the protocol that the daemon will speak */
  uint8_t minor;
  uint16_t reserved;
  uint32_t client_id;   /* as in the daemon's log */
  uint8_t instance[16]; /* random, another one for every start of the daemon */
  uint8_t
      boot_id[16]; /* the kernel's boot id: CLOCK_MONOTONIC is comparable while it is the same */
  int64_t realtime_minus_mono_ns; /* CLOCK_REALTIME - CLOCK_MONOTONIC now; it steps when the clock
                                     is set */
  uint32_t clock_flags;           /* enum geoflow_clock_flags, or-ed */
  uint32_t max_clients;
  uint32_t max_request_bytes; /* larger records from a client end its connection */
  uint32_t stall_timeout_ms;  /* a client that reads nothing for so long is cut off */
  char version[32];           /* of the daemon; zero-filled */
};

enum geoflow_refusal {
  GEOFLOW_REFUSE_MALFORMED = 1, /* not a HELLO */
  GEOFLOW_REFUSE_VERSION = 2,   /* the client's major version is not spoken here */
  GEOFLOW_REFUSE_FULL = 3,      /* too many clients */
  GEOFLOW_REFUSE_TIMEOUT = 4    /* no HELLO in time */
};

struct geoflow_refuse {
  uint32_t reason; /* enum geoflow_refusal */
  uint32_t reserved;
  char text[120]; /* a sentence; zero-filled */
};

enum geoflow_status {
  GEOFLOW_STARTING = 0,     /* no frame yet */
  GEOFLOW_INITIALISING = 1, /* frames arrive, no pose yet */
  GEOFLOW_TRACKING = 2,
  GEOFLOW_DEGRADED =
      3, /* carried by less than the sensors should give: the covariance says how much */
  GEOFLOW_RELOCALISING = 4, /* the map does not match; the odometry goes on */
  GEOFLOW_LOST = 5
};

enum geoflow_sensors { /* what this pose was made from */
                       GEOFLOW_SENSOR_COLOR = 1,
                       GEOFLOW_SENSOR_DEPTH = 2,
                       GEOFLOW_SENSOR_IMU = 4,
                       GEOFLOW_SENSOR_LEGS = 8,
                       GEOFLOW_SENSOR_BODY_VELOCITY = 16
};

/* Frames after REP-105: map -> odom -> base_link; x forward, y left, z up. T_a_b maps coordinates
 * in b to a: its p is the position of b in a. Quaternions are x, y, z, w. Times are CLOCK_MONOTONIC
 * unless they say otherwise. */
struct geoflow_pose {
  int64_t t_capture_ns;   /* middle of the exposure */
  int64_t t_arrival_ns;   /* the frame's last byte reached the host */
  int64_t t_publish_ns;   /* the estimate was handed to the socket's thread */
  int64_t t_recording_ns; /* of the capture, on the recording's own time line; live: t_capture_ns */
  int64_t realtime_minus_mono_ns; /* as in WELCOME, now */
  int64_t sync_error_bound_ns;    /* the true capture is within t_capture_ns +- this */
  uint64_t frame;        /* counts frames from 0; a gap: frames that never reached the estimator */
  double p_odom_base[3]; /* [m]; T_odom_base never jumps */
  double q_odom_base[4];
  double p_map_odom[3]; /* [m]; T_map_odom may jump */
  double q_map_odom[4];
  double v_base[3];      /* velocity of base_link, in base_link [m/s] */
  double w_base[3];      /* angular velocity of base_link, in base_link [rad/s] */
  double covariance[21]; /* of T_odom_base: upper triangle by rows, order x y z rx ry rz, rotation
                            about odom's fixed axes, as nav_msgs/Odometry [m^2, m rad, rad^2] */
  uint8_t status;        /* enum geoflow_status */
  uint8_t source;       /* first guess: 0 none, 1 imu, 2 legs, 3 pnp, 4 gicp, 5 constant velocity */
  uint8_t quality;      /* 0 (nothing) to 100 */
  uint8_t reserved;     /* 0 */
  uint32_t clock_flags; /* enum geoflow_clock_flags, or-ed */
  uint32_t reset_counter; /* counts discontinuities of T_odom_base */
  uint32_t map_id;
  uint32_t visual_inliers; /* map points that agree with the pose */
  uint32_t depth_inliers;  /* depth points that agree with the pose */
  uint32_t sensors;        /* enum geoflow_sensors, or-ed */
  uint32_t frames_dropped; /* frames that the daemon has dropped so far */
  /* since 1.1 */
  int64_t t_frame_ns; /* capture of the frame that the pose goes back to: t_capture_ns, or earlier
                         where it was propagated from there by IMU and legs; 0: a daemon of 1.0 */
};

enum geoflow_stream { GEOFLOW_COLOR = 1, GEOFLOW_DEPTH = 2, GEOFLOW_CLOUD = 3 };

enum geoflow_format {
  GEOFLOW_GRAY8 = 1,   /* a byte a pixel */
  GEOFLOW_DEPTH16 = 2, /* uint16_t a pixel, in units of geoflow_ring.unit_m; 0: not measured */
  GEOFLOW_POINTS = 3   /* geoflow_point, `width` of them */
};

/* A small piece of surface in the map. */
struct geoflow_point {
  float p_map[3];      /* [m] */
  float normal_map[3]; /* unit, towards the camera that saw it */
  float sigma_m;       /* along the normal */
};

enum geoflow_distortion {
  GEOFLOW_UNDISTORTED = 0,
  GEOFLOW_RADTAN = 1,     /* k1 k2 p1 p2 k3: Brown-Conrady */
  GEOFLOW_EQUIDISTANT = 2 /* k1 k2 k3 k4: Kannala-Brandt */
};

/* Comes with the descriptor of a sealed memfd (SCM_RIGHTS), before the first FRAME in it: `slots`
 * slots of `slot_bytes`, each a geoflow_slot and the frame's bytes behind it. To be mapped for
 * reading, shared; it takes the place of an earlier ring of the same stream. */
struct geoflow_ring {
  uint64_t ring;       /* its number; no two of one daemon have the same */
  uint64_t bytes;      /* of all of it */
  uint64_t slot_bytes; /* from one slot to the next */
  uint32_t stream;     /* enum geoflow_stream */
  uint32_t slots;      /* frame n overwrites frame n - slots */
  /* of an image's camera; of a cloud 0 */
  uint32_t distortion_model; /* enum geoflow_distortion */
  uint32_t reserved;         /* 0 */
  double intrinsics[4];      /* fx fy cx cy [px]; the first pixel's centre is (0, 0) */
  double distortion[5];
  double unit_m; /* of depth: metres per count; else 0 */
};

/* The beginning of a slot. A reader takes the frame's bytes and then looks whether `generation`
 * still is the FRAME's: if not, they were overwritten meanwhile. */
struct geoflow_slot {
  uint64_t generation; /* odd: is being written */
  uint8_t reserved[56];
};

struct geoflow_frame {
  int64_t t_capture_ns;   /* middle of the exposure; of a cloud 0 */
  int64_t t_recording_ns; /* likewise on the recording's own time line */
  uint64_t frame;         /* as in the POSE that was made from it; of a cloud: counts clouds */
  uint64_t ring;          /* in which it is */
  uint64_t generation;    /* of its slot, while it is there */
  uint64_t bytes;         /* of the frame */
  uint32_t stream;        /* enum geoflow_stream */
  uint32_t slot;
  uint32_t format; /* enum geoflow_format */
  uint32_t width;  /* [px]; of a cloud: points */
  uint32_t height; /* [px]; of a cloud 1 */
  uint32_t stride; /* bytes from row to row; of a cloud: from point to point */
};

enum geoflow_end_reason {
  GEOFLOW_END_STOPPED = 1, /* the daemon was told to stop */
  GEOFLOW_END_REPLAYED = 2 /* the recording is over */
};

struct geoflow_end {
  uint32_t reason; /* enum geoflow_end_reason */
  uint32_t reserved;
};

GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_header) == 24, "header");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_header, sequence) == 16, "header");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_hello) == 48, "hello");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_hello, name) == 16, "hello");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_welcome) == 96, "welcome");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_welcome, realtime_minus_mono_ns) == 40, "welcome");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_welcome, version) == 64, "welcome");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_refuse) == 128, "refuse");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_pose) == 424, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, frame) == 48, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, p_odom_base) == 56, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, q_odom_base) == 80, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, p_map_odom) == 112, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, q_map_odom) == 136, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, v_base) == 168, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, w_base) == 192, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, covariance) == 216, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, status) == 384, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, clock_flags) == 388, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, frames_dropped) == 412, "pose");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_pose, t_frame_ns) == 416, "pose");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_end) == 8, "end");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_ring) == 120, "ring");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_ring, intrinsics) == 40, "ring");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_ring, unit_m) == 112, "ring");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_slot) == 64, "slot");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_frame) == 72, "frame");
GEOFLOW_STATIC_ASSERT(sizeof(struct geoflow_point) == 28, "point");
GEOFLOW_STATIC_ASSERT(offsetof(struct geoflow_frame, stream) == 48, "frame");

/* NOLINTEND(modernize-*,readability-*) */
#endif /* GEOFLOW_PROTOCOL_H */
