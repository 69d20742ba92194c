#pragma once

#include <cstdint>
#include <string>

#include "geoflow/hal/time.hpp"

namespace geoflow::tests {

/// A TCP connection to this machine, for what no polite client says. Throws std::runtime_error.
class RawConnection {
 public:
  explicit RawConnection(std::uint16_t port);
  RawConnection(const RawConnection&) = delete;
  RawConnection& operator=(const RawConnection&) = delete;
  ~RawConnection();

  /// False once the other side has closed.
  bool send(const std::string& bytes) const;
  /// Reads on until `text` is there, the other side closes, or `timeout`; returns all that came so
  /// far.
  const std::string& read_until(const std::string& text, Duration timeout);
  /// Whether the other side closes within `timeout`.
  [[nodiscard]] bool closes(Duration timeout);

 private:
  [[nodiscard]] bool read_some(HostTime deadline);
  int fd_ = -1;
  bool open_ = true;
  std::string received_;
};

/// An answer to one request.
struct HttpAnswer {
  int status = 0;
  std::string head;
  std::string body;
};

/// One GET of `target` with further header lines (each ending in CRLF); Host is 127.0.0.1:PORT
/// where `headers` has none.
HttpAnswer http_get(std::uint16_t port, const std::string& target, const std::string& headers = {});

}  // namespace geoflow::tests
