#include "http_client.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

#include <arpa/inet.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#include "geoflow/hal/time.hpp"

namespace geoflow::tests {

RawConnection::RawConnection(std::uint16_t port)
    : fd_{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)} {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  sockaddr generic{};
  static_assert(sizeof generic == sizeof address);
  std::memcpy(&generic, &address, sizeof address);
  if (fd_ < 0 || ::connect(fd_, &generic, sizeof generic) != 0) {
    throw std::runtime_error{fmt::format("port {}: cannot be connected to", port)};
  }
}

RawConnection::~RawConnection() {
  ::close(fd_);
}

bool RawConnection::send(const std::string& bytes) const {
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count = ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count <= 0) {
      return false;
    }
    sent += static_cast<std::size_t>(count);
  }
  return true;
}

bool RawConnection::read_some(HostTime deadline) {
  const auto left =
      std::chrono::duration_cast<std::chrono::milliseconds>(deadline - HostClock::now());
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  if (left.count() <= 0 || ::poll(&waiting, 1, static_cast<int>(left.count())) <= 0) {
    return false;
  }
  std::array<char, 65536> buffer{};
  const ssize_t count = ::recv(fd_, buffer.data(), buffer.size(), 0);
  open_ = count > 0;
  received_.append(buffer.data(), static_cast<std::size_t>(open_ ? count : 0));
  return open_;
}

const std::string& RawConnection::read_until(const std::string& text, Duration timeout) {
  const HostTime deadline = HostClock::now() + timeout;
  while (received_.find(text) == std::string::npos && read_some(deadline)) {
  }
  return received_;
}

bool RawConnection::closes(Duration timeout) {
  const HostTime deadline = HostClock::now() + timeout;
  while (read_some(deadline)) {
  }
  return !open_;
}

HttpAnswer http_get(std::uint16_t port, const std::string& target, const std::string& headers) {
  RawConnection connection{port};
  const std::string host =
      headers.find("Host:") == std::string::npos ? fmt::format("Host: 127.0.0.1:{}\r\n", port) : "";
  connection.send(
      fmt::format("GET {} HTTP/1.1\r\n{}{}Connection: close\r\n\r\n", target, host, headers));
  const std::string all =
      connection.read_until(std::string{"\0never", 6}, std::chrono::seconds{10});
  const std::size_t end = all.find("\r\n\r\n");
  if (!all.starts_with("HTTP/1.1 ") || end == std::string::npos) {
    throw std::runtime_error{"no answer: " + all};
  }
  return {.status = std::stoi(all.substr(9, 3)),
          .head = all.substr(0, end),
          .body = all.substr(end + 4)};
}

}  // namespace geoflow::tests
