/* Prints, of each image as it comes, stream, frame, width, height, and the mean of its pixels: gray
 * of colour images, metres of depth images.
 *
 *   cc -std=c11 -I/usr/share/geoflow/c example_frames.c /usr/share/geoflow/c/geoflow_client.c -o
 * example
 *   ./example [SOCKET [COUNT]]     COUNT: end after so many images */
#include <stdio.h>
#include <stdlib.h>

#include "geoflow_client.h"

/* Of those that were measured, in the image's units. */
static double mean(const struct geoflow_frame* frame, const void* pixels) {
  const size_t count = (size_t)frame->width * frame->height;
  double sum = 0;
  size_t measured = 0;
  size_t i = 0;
  for (i = 0; i < count; ++i) {
    const unsigned value = frame->format == GEOFLOW_DEPTH16 ? ((const uint16_t*)pixels)[i]
                                                            : ((const unsigned char*)pixels)[i];
    sum += value;
    measured += value > 0;
  }
  return measured > 0 ? sum / (double)measured : 0;
}

/* Returns 1 where the frame could be shown, 0 where it came too late, -1 without memory. */
static int show(struct geoflow_client* client, const struct geoflow_frame* frame) {
  const double unit_m = client->rings[frame->stream - 1].about.unit_m;
  void* const pixels = malloc(frame->bytes);
  int shown = -1;
  if (pixels != NULL) {
    shown = geoflow_copy_frame(client, frame, pixels) == 0;
  }
  if (shown > 0) {
    printf("%s %llu %u %u %.3f\n", frame->stream == GEOFLOW_DEPTH ? "depth" : "color",
           (unsigned long long)frame->frame, frame->width, frame->height,
           mean(frame, pixels) * (unit_m > 0 ? unit_m : 1));
    fflush(stdout);
  }
  free(pixels);
  return shown;
}

int main(int argc, char** argv) {
  struct geoflow_client client;
  struct geoflow_event event;
  struct geoflow_options options = {0};
  enum geoflow_received received = GEOFLOW_RECEIVED;
  const long count = argc > 2 ? strtol(argv[2], NULL, 10) : 0;
  long shown = 0;
  options.socket = argc > 1 ? argv[1] : NULL;
  options.name = "example_frames.c";
  options.want = GEOFLOW_WANT_COLOR | GEOFLOW_WANT_DEPTH;
  if (geoflow_connect(&client, &options) != 0) {
    fprintf(stderr, "example: %s\n", client.error);
    return 4;
  }
  while ((count == 0 || shown < count) &&
         (received = geoflow_next(&client, &event, -1)) == GEOFLOW_RECEIVED) {
    const int done = event.type == GEOFLOW_FRAME ? show(&client, &event.frame) : 0;
    if (done < 0) {
      break;
    }
    shown += done;
  }
  if (received == GEOFLOW_FAILED) {
    fprintf(stderr, "example: %s\n", client.error);
  }
  geoflow_close(&client);
  return received == GEOFLOW_FAILED ? 1 : 0;
}
