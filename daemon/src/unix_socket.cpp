#include "src/unix_socket.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <string>

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

Result<UniqueFd> connect_to(const std::filesystem::path& socket, int type) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = socket.string();
  if (text.size() >= sizeof address.sun_path) {
    return fail(ErrorCode::kInvalidArgument, "{}: a socket's path has at most {} bytes", text,
                sizeof address.sun_path - 1);
  }
  std::memcpy(&address.sun_path[0], text.data(), text.size());
  UniqueFd fd{::socket(AF_UNIX, type | SOCK_CLOEXEC, 0)};
  const void* generic = &address;
  if (fd && ::connect(fd.get(), static_cast<const sockaddr*>(generic), sizeof address) == 0) {
    return fd;
  }
  if (errno == ECONNREFUSED) {
    return fail(ErrorCode::kUnavailable, "{}: no daemon answers", text);
  }
  if (errno == ENOENT) {
    return fail(ErrorCode::kUnavailable, "{}: no such socket; is geoflowd running?", text);
  }
  return fail_errno(text);
}

Result<bool> wait_readable(int fd, Duration timeout) {
  pollfd waiting{.fd = fd, .events = POLLIN, .revents = 0};
  const auto left =
      std::max(std::chrono::ceil<std::chrono::milliseconds>(timeout), std::chrono::milliseconds{0});
  const int ready = ::poll(&waiting, 1, static_cast<int>(left.count()));
  if (ready < 0 && errno != EINTR) {
    return fail_errno("poll");
  }
  return ready > 0;
}

}  // namespace geoflow::daemon
