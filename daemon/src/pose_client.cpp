#include "geoflow/daemon/pose_client.hpp"

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/un.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {
namespace {

constexpr auto kHandshakeTimeout = std::chrono::seconds{5};

Result<UniqueFd> connect_to(const std::filesystem::path& socket) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = socket.string();
  if (text.size() >= sizeof address.sun_path) {
    return fail(ErrorCode::kInvalidArgument, "{}: a socket's path has at most {} bytes", text,
                sizeof address.sun_path - 1);
  }
  std::memcpy(&address.sun_path[0], text.data(), text.size());
  UniqueFd fd{::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)};
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

/// The bytes of the next datagram; empty when the peer has closed; nothing after `timeout` or a
/// signal.
Result<std::optional<std::vector<std::byte>>> receive_datagram(int fd, Duration timeout) {
  pollfd waiting{.fd = fd, .events = POLLIN, .revents = 0};
  const auto milliseconds = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
  const int ready = ::poll(&waiting, 1, static_cast<int>(milliseconds));
  if (ready == 0 || (ready < 0 && errno == EINTR)) {
    return std::nullopt;
  }
  std::vector<std::byte> bytes(GEOFLOW_MAX_RECORD);
  const ssize_t size = ready < 0 ? -1 : ::recv(fd, bytes.data(), bytes.size(), 0);
  if (size < 0 && errno == ECONNRESET) {
    bytes.clear();
    return bytes;
  }
  if (size < 0) {
    return fail_errno("pose socket");
  }
  bytes.resize(static_cast<std::size_t>(size));
  return bytes;
}

Result<geoflow_welcome> judge_answer(std::span<const std::byte> bytes) {
  const auto record = parse_record(bytes);
  if (!record) {
    return tl::unexpected{record.error()};
  }
  if (record->header.type == GEOFLOW_REFUSE) {
    const auto refuse = read_payload<geoflow_refuse>(record->payload);
    const std::string_view text{&refuse.text[0], sizeof refuse.text};
    return fail(ErrorCode::kUnavailable, "the daemon refused: {}", text.substr(0, text.find('\0')));
  }
  if (record->header.type != GEOFLOW_WELCOME) {
    return fail(ErrorCode::kInvalidData, "the daemon answered HELLO with a record of type {}",
                record->header.type);
  }
  return read_payload<geoflow_welcome>(record->payload);
}

}  // namespace

Result<PoseClient> PoseClient::connect(const std::filesystem::path& socket,
                                       const Options& options) {
  auto fd = connect_to(socket);
  if (!fd) {
    return tl::unexpected{std::move(fd.error())};
  }
  geoflow_hello hello{};
  hello.client_major = GEOFLOW_PROTOCOL_MAJOR;
  hello.client_minor = GEOFLOW_PROTOCOL_MINOR;
  hello.want = options.propagated ? GEOFLOW_WANT_PROPAGATED : GEOFLOW_WANT_POSE;
  hello.max_rate_hz = options.max_rate_hz;
  copy_text(hello.name, options.name);
  const std::vector<std::byte> bytes = encode_record(GEOFLOW_HELLO, 0, 0, hello);
  // A daemon that refuses may have shut its end already; its reason can still be read.
  if (::send(fd->get(), bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0 && errno != EPIPE) {
    return fail_errno(socket.string());
  }
  const auto answer = receive_datagram(fd->get(), kHandshakeTimeout);
  if (!answer) {
    return tl::unexpected{answer.error()};
  }
  const std::optional<std::vector<std::byte>>& bytes_of_answer = *answer;
  if (!bytes_of_answer || bytes_of_answer->empty()) {
    return fail(ErrorCode::kUnavailable, "{}: the daemon does not answer", socket.string());
  }
  return judge_answer(*bytes_of_answer)
      .map([&](const geoflow_welcome& welcome) { return PoseClient{std::move(*fd), welcome}; })
      .map_error([&](Error error) { return std::move(error).in(socket.string()); });
}

Result<PoseClient::Received> PoseClient::receive(Duration timeout) {
  while (true) {
    const auto received = receive_datagram(fd_.get(), timeout);
    if (!received) {
      return tl::unexpected{received.error()};
    }
    const std::optional<std::vector<std::byte>>& bytes = *received;
    if (!bytes) {
      return TimedOut{};
    }
    const HostTime now = HostClock::now();
    if (bytes->empty()) {
      return Ended{};
    }
    const auto record = parse_record(*bytes);
    if (!record) {
      return tl::unexpected{record.error()};
    }
    if (record->header.type == GEOFLOW_POSE) {
      return ReceivedPose{.pose = read_payload<geoflow_pose>(record->payload),
                          .dropped = record->header.dropped,
                          .t_received = now};
    }
    if (record->header.type == GEOFLOW_END) {
      return Ended{.reason = read_payload<geoflow_end>(record->payload).reason};
    }
  }
}

}  // namespace geoflow::daemon
