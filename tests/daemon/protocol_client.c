/* A client in C11 with nothing but the protocol's header. */
#include <stddef.h>
#include <string.h>

#include "geoflow/daemon/geoflow_protocol.h"

int geoflow_c_read_pose(const void* record, size_t size, double* x, unsigned* status);

int geoflow_c_read_pose(const void* record, size_t size, double* x, unsigned* status) {
  struct geoflow_header header;
  struct geoflow_pose pose;
  size_t known = 0;
  if (size < sizeof header) {
    return -1;
  }
  memcpy(&header, record, sizeof header);
  if (header.magic != GEOFLOW_MAGIC || header.major != GEOFLOW_PROTOCOL_MAJOR ||
      header.type != GEOFLOW_POSE || header.payload_len != size - sizeof header) {
    return -1;
  }
  known = header.payload_len < sizeof pose ? header.payload_len : sizeof pose;
  memset(&pose, 0, sizeof pose);
  memcpy(&pose, (const char*)record + sizeof header, known);
  *x = pose.p_odom_base[0];
  *status = pose.status;
  return 0;
}
