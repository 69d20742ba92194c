/* Preloaded into a program: what it sends to the journal is appended to the file that
 * $GEOFLOW_JOURNAL names, each entry with a blank line behind it; without that, the journal takes
 * nothing. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/uio.h>

int sd_journal_sendv(const struct iovec* fields, int count);

int sd_journal_sendv(const struct iovec* fields, int count) {
  const char* const path = getenv("GEOFLOW_JOURNAL");
  FILE* const file = path != NULL ? fopen(path, "a") : NULL;
  if (file == NULL) {
    return -EIO;
  }
  for (int i = 0; i < count; ++i) {
    fwrite(fields[i].iov_base, 1, fields[i].iov_len, file);
    fputc('\n', file);
  }
  fputc('\n', file);
  return fclose(file) == 0 ? 0 : -EIO;
}
