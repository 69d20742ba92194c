/* Prints the robot's place in the map, as it comes: status, frame, x, y, z [m], and its age [ms].
 *
 *   cc -std=c11 -I/usr/share/geoflow/c example.c /usr/share/geoflow/c/geoflow_client.c -o example
 *   ./example [SOCKET [COUNT]]     COUNT: end after so many poses */
#define _POSIX_C_SOURCE 200809L /* clock_gettime */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "geoflow_client.h"

static double age_ms(const struct geoflow_pose* pose) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return ((double)now.tv_sec * 1e9 + (double)now.tv_nsec - (double)pose->t_capture_ns) * 1e-6;
}

int main(int argc, char** argv) {
  struct geoflow_client client;
  struct geoflow_pose pose;
  struct geoflow_options options = {0};
  enum geoflow_received received = GEOFLOW_RECEIVED;
  const long count = argc > 2 ? strtol(argv[2], NULL, 10) : 0;
  long shown = 0;
  options.socket = argc > 1 ? argv[1] : NULL;
  options.name = "example.c";
  if (geoflow_connect(&client, &options) != 0) {
    fprintf(stderr, "example: %s\n", client.error);
    return 4;
  }
  while ((count == 0 || shown < count) &&
         (received = geoflow_next_pose(&client, &pose, -1)) == GEOFLOW_RECEIVED) {
    double p[3];
    double q[4];
    geoflow_map_from_base(&pose, p, q);
    printf("%s %llu %.4f %.4f %.4f %.1f\n", geoflow_status_name(pose.status),
           (unsigned long long)pose.frame, p[0], p[1], p[2], age_ms(&pose));
    fflush(stdout);
    ++shown;
  }
  if (received == GEOFLOW_FAILED) {
    fprintf(stderr, "example: %s\n", client.error);
  }
  geoflow_close(&client);
  return received == GEOFLOW_FAILED ? 1 : 0;
}
