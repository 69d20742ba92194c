#include "geoflow/daemon/pose_client.hpp"

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/socket.h>
#include <sys/types.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "src/unix_socket.hpp"

namespace geoflow::daemon {
namespace {

constexpr auto kHandshakeTimeout = std::chrono::seconds{5};

/// The bytes of the next datagram; empty when the peer has closed; nothing after `timeout` or a
/// signal.
Result<std::optional<std::vector<std::byte>>> receive_datagram(int fd, Duration timeout) {
  const auto readable = wait_readable(fd, timeout);
  if (!readable) {
    return tl::unexpected{readable.error()};
  }
  if (!*readable) {
    return std::nullopt;
  }
  std::vector<std::byte> bytes(GEOFLOW_MAX_RECORD);
  const ssize_t size = ::recv(fd, bytes.data(), bytes.size(), 0);
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
  auto fd = connect_to(socket, SOCK_SEQPACKET);
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
