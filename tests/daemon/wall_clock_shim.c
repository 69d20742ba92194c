/* Preloaded into a program: its wall clock stands 20 days ahead from the moment on at which the
 * file named by $GEOFLOW_WALL_CLOCK_AHEAD is there. */
#define _GNU_SOURCE /* RTLD_NEXT */
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { AHEAD_S = 20 * 24 * 3600 };

int clock_gettime(clockid_t clock, struct timespec* now) {
  static int (*real)(clockid_t, struct timespec*);
  if (real == NULL) {
    *(void**)&real = dlsym(RTLD_NEXT, "clock_gettime");
  }
  const int status = real(clock, now);
  if (clock == CLOCK_REALTIME && status == 0) {
    const char* const sign = getenv("GEOFLOW_WALL_CLOCK_AHEAD");
    now->tv_sec += sign != NULL && access(sign, F_OK) == 0 ? AHEAD_S : 0;
  }
  return status;
}
