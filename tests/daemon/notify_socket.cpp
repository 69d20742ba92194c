#include "notify_socket.hpp"

#include <array>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>

#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/un.h>

#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::tests {

NotifySocket::NotifySocket(std::filesystem::path path)
    : path_{std::move(path)}, fd_{::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)} {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(&address.sun_path[0], path_.c_str(), sizeof address.sun_path - 1);
  const void* generic = &address;
  if (!fd_ || ::bind(fd_.get(), static_cast<const sockaddr*>(generic), sizeof address) != 0) {
    throw std::runtime_error{"cannot bind " + path_.string()};
  }
}

bool NotifySocket::wait_for(const std::string& text, Duration timeout) {
  const HostTime deadline = HostClock::now() + timeout;
  while (HostClock::now() < deadline) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - HostClock::now()).count();
    pollfd watched{.fd = fd_.get(), .events = POLLIN, .revents = 0};
    if (::poll(&watched, 1, static_cast<int>(left)) <= 0) {
      continue;
    }
    std::array<char, 4096> buffer{};
    const ssize_t size = ::recv(fd_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (size >= 0) {
      messages_.emplace_back(buffer.data(), static_cast<std::size_t>(size));
      if (messages_.back().find(text) != std::string::npos) {
        return true;
      }
    }
  }
  return false;
}

bool NotifySocket::is_silent_of(const std::string& text, Duration duration) {
  return !wait_for(text, duration);
}

}  // namespace geoflow::tests
