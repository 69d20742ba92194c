/* A client of geoflowd's pose socket in C11, with nothing but libc.
 *
 *   struct geoflow_client client;
 *   struct geoflow_pose pose;
 *   if (geoflow_connect(&client, NULL) != 0) { puts(client.error); return 1; }
 *   while (geoflow_next_pose(&client, &pose, -1) == GEOFLOW_RECEIVED) {
 *     printf("%.3f %.3f %.3f\n", pose.p_odom_base[0], pose.p_odom_base[1], pose.p_odom_base[2]);
 *   }
 *   geoflow_close(&client);
 *
 * Images come in memory that is shared with the daemon: geoflow_next(), geoflow_copy_frame().
 *
 * Copy geoflow_client.h and geoflow_client.c into your program, and
 * geoflow/daemon/geoflow_protocol.h, which describes the records, to where it looks for headers. A
 * client belongs to one thread at a time; any number of clients may be connected. For machines with
 * little-endian numbers. */
#ifndef GEOFLOW_CLIENT_H
#define GEOFLOW_CLIENT_H

#include "geoflow/daemon/geoflow_protocol.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GEOFLOW_POSE_SOCKET "/run/geoflow/pose.sock"

enum { GEOFLOW_STREAMS = 3 }; /* colour, depth, cloud */

/* Memory with frames of one stream. */
struct geoflow_mapped_ring {
  struct geoflow_ring about;   /* where its frames are, and of which camera */
  const unsigned char* memory; /* NULL: there is none yet */
};

struct geoflow_client {
  int fd;                         /* -1: not connected; may be watched by poll() for reading */
  struct geoflow_welcome welcome; /* what the daemon said of itself */
  uint32_t
      dropped; /* poses, or frames of that stream, missed before the newest one for being slow */
  uint32_t
      end_reason;  /* after GEOFLOW_ENDED: enum geoflow_end_reason; 0: it has gone without a word */
  char error[256]; /* after a failure: a sentence */
  struct geoflow_mapped_ring rings[GEOFLOW_STREAMS]; /* of colour, depth, cloud */
};

/* What has come. */
struct geoflow_event {
  enum geoflow_record_type type; /* GEOFLOW_POSE or GEOFLOW_FRAME */
  struct geoflow_pose pose;
  struct geoflow_frame frame;
};

/* What is left zero has its default. */
struct geoflow_options {
  const char* socket; /* path; NULL: GEOFLOW_POSE_SOCKET */
  const char* name;   /* for the daemon's log; NULL: none */
  uint32_t want;      /* enum geoflow_want; 0: GEOFLOW_WANT_POSE */
  double max_rate_hz; /* poses, and frames of each stream, a second at most; 0: every one */
};

enum geoflow_received {
  GEOFLOW_FAILED = -1,   /* client->error says why; close it */
  GEOFLOW_RECEIVED = 0,  /* a pose, or a frame */
  GEOFLOW_TIMED_OUT = 1, /* none came in time, or a signal did */
  GEOFLOW_ENDED = 2      /* no more will follow: close it */
};

/* Connects and shakes hands, within 5 s. `options` may be NULL. Returns 0, or -1 with client->error
 * set; then the client is closed. */
int geoflow_connect(struct geoflow_client* client, const struct geoflow_options* options);

/* Waits for the next pose at most `timeout_ms` (negative: for ever; 0: takes what is there). */
enum geoflow_received geoflow_next_pose(struct geoflow_client* client, struct geoflow_pose* pose,
                                        int timeout_ms);

/* Likewise for the next pose or frame, whichever is wanted and comes first. */
enum geoflow_received geoflow_next(struct geoflow_client* client, struct geoflow_event* event,
                                   int timeout_ms);

/* Copies the bytes of the frame that came to `buffer`, which has room for frame->bytes. Returns 0;
 * or -1, with client->error set, where they have been overwritten by now: a ring of images has
 * 8, so take each as soon as it comes. A cloud's are struct geoflow_point.
 * client->rings[frame->stream - 1].about has the camera's intrinsics and the unit of depth. */
int geoflow_copy_frame(struct geoflow_client* client, const struct geoflow_frame* frame,
                       void* buffer);

/* Idempotent; also after geoflow_connect() has failed. */
void geoflow_close(struct geoflow_client* client);

/* The base in the map: T_map_base = T_map_odom * T_odom_base as position [m] and quaternion x, y,
 * z, w. */
void geoflow_map_from_base(const struct geoflow_pose* pose, double p_map_base[3],
                           double q_map_base[4]);

/* "TRACKING" for GEOFLOW_TRACKING and so on; "UNKNOWN" for what this version does not know. */
const char* geoflow_status_name(uint8_t status);

/* Splits a record of `size` bytes: its header, and the payload copied to `payload`, of which a part
 * that the sender did not have yet is zero, and what it had besides is left out. Returns 0, or -1
 * where the bytes are no record. For who reads the socket, or records that were kept, himself. */
int geoflow_parse(const void* record, size_t size, struct geoflow_header* header, void* payload,
                  size_t payload_size);

/* Writes the HELLO for these options (NULL: the defaults) to `record`, of 72 bytes. */
void geoflow_make_hello(const struct geoflow_options* options, unsigned char record[72]);

#ifdef __cplusplus
}
#endif
#endif /* GEOFLOW_CLIENT_H */
