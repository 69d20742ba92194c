#define _GNU_SOURCE /* SOCK_CLOEXEC, F_GET_SEALS */
#include "geoflow_client.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "records are copied as they stand: little-endian machines only"
#endif

enum { HANDSHAKE_TIMEOUT_MS = 5000 };

_Static_assert(sizeof(struct geoflow_header) + sizeof(struct geoflow_hello) == 72, "hello");

static int fail(struct geoflow_client* client, const char* format, ...)
    __attribute__((format(printf, 2, 3)));

static int fail(struct geoflow_client* client, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(client->error, sizeof client->error, format, arguments);
  va_end(arguments);
  return -1;
}

int geoflow_parse(const void* record, size_t size, struct geoflow_header* header, void* payload,
                  size_t payload_size) {
  size_t known = 0;
  memset(payload, 0, payload_size);
  if (size < sizeof *header) {
    return -1;
  }
  memcpy(header, record, sizeof *header);
  if (header->magic != GEOFLOW_MAGIC || header->payload_len != size - sizeof *header) {
    return -1;
  }
  known = header->payload_len < payload_size ? header->payload_len : payload_size;
  memcpy(payload, (const unsigned char*)record + sizeof *header, known);
  return 0;
}

void geoflow_make_hello(const struct geoflow_options* options, unsigned char record[72]) {
  struct geoflow_header header;
  struct geoflow_hello hello;
  memset(&header, 0, sizeof header);
  memset(&hello, 0, sizeof hello);
  header.magic = GEOFLOW_MAGIC;
  header.major = GEOFLOW_PROTOCOL_MAJOR;
  header.minor = GEOFLOW_PROTOCOL_MINOR;
  header.type = GEOFLOW_HELLO;
  header.payload_len = sizeof hello;
  hello.client_major = GEOFLOW_PROTOCOL_MAJOR;
  hello.client_minor = GEOFLOW_PROTOCOL_MINOR;
  hello.want = options != NULL && options->want != 0 ? options->want : (uint32_t)GEOFLOW_WANT_POSE;
  hello.max_rate_hz = options != NULL ? options->max_rate_hz : 0.0;
  if (options != NULL && options->name != NULL) {
    const size_t length = strnlen(options->name, sizeof hello.name - 1);
    memcpy(hello.name, options->name, length);
  }
  memcpy(record, &header, sizeof header);
  memcpy(record + sizeof header, &hello, sizeof hello);
}

/* One datagram: its size, 0 where the daemon has closed, -1 with errno, -2 where none came in time.
 * A descriptor that came with it is the caller's, in *passed; else that is -1. */
static ssize_t receive(int fd, unsigned char* record, int timeout_ms, int* passed) {
  union {
    struct cmsghdr header;
    char space[CMSG_SPACE(sizeof(int))];
  } control;
  struct iovec part;
  struct msghdr message;
  struct cmsghdr* header = NULL;
  struct pollfd waiting;
  int ready = 0;
  ssize_t size = 0;
  *passed = -1;
  waiting.fd = fd;
  waiting.events = POLLIN;
  waiting.revents = 0;
  ready = poll(&waiting, 1, timeout_ms);
  if (ready == 0 || (ready < 0 && errno == EINTR)) {
    return -2;
  }
  part.iov_base = record;
  part.iov_len = GEOFLOW_MAX_RECORD;
  memset(&message, 0, sizeof message);
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.space;
  message.msg_controllen = sizeof control.space;
  size = ready < 0 ? -1 : recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
  if (size < 0) {
    return errno == ECONNRESET ? 0 : size;
  }
  header = CMSG_FIRSTHDR(&message);
  if (header != NULL && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_RIGHTS) {
    memcpy(passed, CMSG_DATA(header), sizeof *passed);
  }
  return size;
}

static void close_if_open(int fd) {
  if (fd >= 0) {
    close(fd);
  }
}

static int shake_hands(struct geoflow_client* client, const struct geoflow_options* options) {
  unsigned char record[GEOFLOW_MAX_RECORD];
  struct geoflow_header header;
  struct geoflow_refuse refuse;
  ssize_t size = 0;
  int passed = -1;
  geoflow_make_hello(options, record);
  /* A daemon that refuses may have shut its end already; its reason can still be read. */
  if (send(client->fd, record, 72, MSG_NOSIGNAL) < 0 && errno != EPIPE) {
    return fail(client, "HELLO cannot be sent: %s", strerror(errno));
  }
  size = receive(client->fd, record, HANDSHAKE_TIMEOUT_MS, &passed);
  close_if_open(passed);
  if (size == -1) {
    return fail(client, "the daemon's answer cannot be read: %s", strerror(errno));
  }
  if (size <= 0) {
    return fail(client, "the daemon does not answer");
  }
  if (geoflow_parse(record, (size_t)size, &header, &refuse, sizeof refuse) == 0 &&
      header.type == GEOFLOW_REFUSE) {
    return fail(client, "the daemon refused: %.119s", refuse.text);
  }
  if (geoflow_parse(record, (size_t)size, &header, &client->welcome, sizeof client->welcome) != 0 ||
      header.type != GEOFLOW_WELCOME) {
    return fail(client, "what answers is no geoflowd");
  }
  return 0;
}

static int open_socket(struct geoflow_client* client, const char* path) {
  struct sockaddr_un address;
  memset(&address, 0, sizeof address);
  address.sun_family = AF_UNIX;
  if (strlen(path) >= sizeof address.sun_path) {
    return fail(client, "a socket's path has at most %zu bytes", sizeof address.sun_path - 1);
  }
  memcpy(address.sun_path, path, strlen(path));
  client->fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (client->fd < 0 ||
      connect(client->fd, (const struct sockaddr*)&address, sizeof address) != 0) {
    return fail(client, "%.100s: %s", path, strerror(errno));
  }
  return 0;
}

int geoflow_connect(struct geoflow_client* client, const struct geoflow_options* options) {
  const char* path =
      options != NULL && options->socket != NULL ? options->socket : GEOFLOW_POSE_SOCKET;
  memset(client, 0, sizeof *client);
  client->fd = -1;
  if (open_socket(client, path) == 0 && shake_hands(client, options) == 0) {
    return 0;
  }
  geoflow_close(client);
  return -1;
}

static void unmap(struct geoflow_mapped_ring* ring) {
  if (ring->memory != NULL) {
    munmap((void*)(uintptr_t)ring->memory, ring->about.bytes);
    ring->memory = NULL;
  }
}

/* Whether the ring is as it says, and stays so: what could shrink would end its reader. */
static int is_sound(const struct geoflow_ring* ring, int fd) {
  struct stat status;
  const int seals = fcntl(fd, F_GET_SEALS);
  return seals >= 0 && (seals & F_SEAL_SHRINK) != 0 && fstat(fd, &status) == 0 &&
         (uint64_t)status.st_size >= ring->bytes && ring->slots > 0 &&
         ring->slot_bytes > sizeof(struct geoflow_slot) && ring->slot_bytes % 8 == 0 &&
         ring->slot_bytes <= ring->bytes / ring->slots;
}

/* A ring of a stream that this version does not know is left alone. */
static int map_ring(struct geoflow_client* client, const struct geoflow_ring* about, int fd) {
  struct geoflow_mapped_ring* ring = NULL;
  void* memory = NULL;
  if (about->stream < 1 || about->stream > GEOFLOW_STREAMS) {
    return 0;
  }
  if (fd < 0 || !is_sound(about, fd)) {
    return fail(client, "the daemon's memory for frames is not as it says");
  }
  memory = mmap(NULL, about->bytes, PROT_READ, MAP_SHARED, fd, 0);
  if (memory == MAP_FAILED) {
    return fail(client, "the daemon's memory for frames cannot be mapped: %s", strerror(errno));
  }
  ring = &client->rings[about->stream - 1];
  unmap(ring);
  ring->about = *about;
  ring->memory = memory;
  return 0;
}

/* The slot of a frame that came; NULL where its ring is not there. */
static const unsigned char* slot_of(const struct geoflow_client* client,
                                    const struct geoflow_frame* frame) {
  const struct geoflow_mapped_ring* ring = NULL;
  if (frame->stream < 1 || frame->stream > GEOFLOW_STREAMS) {
    return NULL;
  }
  ring = &client->rings[frame->stream - 1];
  if (ring->memory == NULL || ring->about.ring != frame->ring || frame->slot >= ring->about.slots ||
      frame->bytes > ring->about.slot_bytes - sizeof(struct geoflow_slot)) {
    return NULL;
  }
  return ring->memory + frame->slot * ring->about.slot_bytes;
}

static uint64_t generation_of(const unsigned char* slot) {
  return __atomic_load_n((const uint64_t*)(const void*)slot, __ATOMIC_ACQUIRE);
}

int geoflow_copy_frame(struct geoflow_client* client, const struct geoflow_frame* frame,
                       void* buffer) {
  const unsigned char* const slot = slot_of(client, frame);
  if (slot != NULL && generation_of(slot) == frame->generation) {
    memcpy(buffer, slot + sizeof(struct geoflow_slot), frame->bytes);
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    if (generation_of(slot) == frame->generation) {
      return 0;
    }
  }
  return fail(client, "the frame is no longer there");
}

/* What a record is to who waits for poses and frames; GEOFLOW_TIMED_OUT: nothing. */
static enum geoflow_received take(struct geoflow_client* client, const unsigned char* record,
                                  size_t size, int passed, struct geoflow_event* event) {
  struct geoflow_header header;
  struct geoflow_ring ring;
  struct geoflow_end end;
  if (geoflow_parse(record, size, &header, &event->pose, sizeof event->pose) != 0) {
    (void)fail(client, "the daemon sent what is no record");
    return GEOFLOW_FAILED;
  }
  switch (header.type) {
    case GEOFLOW_POSE:
      break;
    case GEOFLOW_FRAME:
      (void)geoflow_parse(record, size, &header, &event->frame, sizeof event->frame);
      if (slot_of(client, &event->frame) == NULL) {
        return GEOFLOW_TIMED_OUT; /* of a stream of a later version */
      }
      break;
    case GEOFLOW_RING:
      (void)geoflow_parse(record, size, &header, &ring, sizeof ring);
      return map_ring(client, &ring, passed) == 0 ? GEOFLOW_TIMED_OUT : GEOFLOW_FAILED;
    case GEOFLOW_END:
      (void)geoflow_parse(record, size, &header, &end, sizeof end);
      client->end_reason = end.reason;
      return GEOFLOW_ENDED;
    default:
      return GEOFLOW_TIMED_OUT; /* a record of a later version */
  }
  client->dropped = header.dropped;
  event->type = (enum geoflow_record_type)header.type;
  return GEOFLOW_RECEIVED;
}

enum geoflow_received geoflow_next(struct geoflow_client* client, struct geoflow_event* event,
                                   int timeout_ms) {
  enum geoflow_received received = GEOFLOW_TIMED_OUT;
  while (received == GEOFLOW_TIMED_OUT) {
    unsigned char record[GEOFLOW_MAX_RECORD];
    int passed = -1;
    const ssize_t size = receive(client->fd, record, timeout_ms, &passed);
    if (size == -2) {
      return GEOFLOW_TIMED_OUT;
    }
    if (size == -1) {
      (void)fail(client, "the pose socket cannot be read: %s", strerror(errno));
      return GEOFLOW_FAILED;
    }
    if (size == 0) {
      client->end_reason = 0;
      return GEOFLOW_ENDED;
    }
    received = take(client, record, (size_t)size, passed, event);
    close_if_open(passed);
  }
  return received;
}

enum geoflow_received geoflow_next_pose(struct geoflow_client* client, struct geoflow_pose* pose,
                                        int timeout_ms) {
  struct geoflow_event event;
  enum geoflow_received received = GEOFLOW_RECEIVED;
  do {
    received = geoflow_next(client, &event, timeout_ms);
  } while (received == GEOFLOW_RECEIVED && event.type != GEOFLOW_POSE);
  if (received == GEOFLOW_RECEIVED) {
    *pose = event.pose;
  }
  return received;
}

void geoflow_close(struct geoflow_client* client) {
  int i = 0;
  close_if_open(client->fd);
  client->fd = -1;
  for (i = 0; i < GEOFLOW_STREAMS; ++i) {
    unmap(&client->rings[i]);
  }
}

/* The vector v turned by the unit quaternion q. */
static void rotate(const double q[4], const double v[3], double turned[3]) {
  const double t[3] = {2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]),
                       2 * (q[0] * v[1] - q[1] * v[0])};
  turned[0] = v[0] + q[3] * t[0] + q[1] * t[2] - q[2] * t[1];
  turned[1] = v[1] + q[3] * t[1] + q[2] * t[0] - q[0] * t[2];
  turned[2] = v[2] + q[3] * t[2] + q[0] * t[1] - q[1] * t[0];
}

void geoflow_map_from_base(const struct geoflow_pose* pose, double p_map_base[3],
                           double q_map_base[4]) {
  const double* a = pose->q_map_odom;
  const double* b = pose->q_odom_base;
  int i = 0;
  rotate(a, pose->p_odom_base, p_map_base);
  for (i = 0; i < 3; ++i) {
    p_map_base[i] += pose->p_map_odom[i];
  }
  q_map_base[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1];
  q_map_base[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0];
  q_map_base[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3];
  q_map_base[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
}

const char* geoflow_status_name(uint8_t status) {
  static const char* const names[] = {"STARTING", "INITIALISING", "TRACKING",
                                      "DEGRADED", "RELOCALISING", "LOST"};
  return status < sizeof names / sizeof names[0] ? names[status] : "UNKNOWN";
}
