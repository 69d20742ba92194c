#include "server/pose_connection.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>

#include <sys/socket.h>
#include <sys/types.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/time.hpp"

#include "server/acceptor.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {
namespace {

constexpr double kRequestsPerSecond = 50;
constexpr double kRequestBurst = 100;
constexpr int kReceivesAtOnce = 16;

}  // namespace

PoseConnection::PoseConnection(Connection connection, std::uint32_t id, HostTime now)
    : connection_{std::move(connection)},
      id_{id},
      requests_{kRequestsPerSecond, kRequestBurst, now},
      waiting_since_{now} {}

PoseConnection::Outcome PoseConnection::receive(const geoflow_welcome& welcome, HostTime now) {
  std::array<std::byte, GEOFLOW_MAX_RECORD> buffer{};
  for (int i = 0; i < kReceivesAtOnce; ++i) {
    // recv, not recvmsg: without a control buffer the kernel closes descriptors that a client
    // passes.
    const ssize_t size = ::recv(fd(), buffer.data(), buffer.size(), MSG_DONTWAIT | MSG_TRUNC);
    if (size < 0) {
      return errno == EAGAIN || errno == EINTR ? Outcome::kOpen : Outcome::kLost;
    }
    const auto length = static_cast<std::size_t>(size);
    if (length == 0 || length > buffer.size() || !requests_.take(now)) {
      return Outcome::kLost;
    }
    if (!welcomed_) {
      const Outcome greeted = greet(std::span{buffer}.first(length), welcome);
      if (greeted != Outcome::kOpen) {
        return greeted;
      }
    }  // what a later minor version may say after HELLO is ignored
  }
  return Outcome::kOpen;
}

PoseConnection::Outcome PoseConnection::greet(std::span<const std::byte> datagram,
                                              const geoflow_welcome& welcome) {
  auto hello = parse_hello(datagram);
  if (!hello) {
    refuse(hello.error().reason, hello.error().text);
    return Outcome::kLost;
  }
  name_ = std::move(hello->name);
  wants_pose_ = hello->wants_pose;
  wants_propagated_ = hello->wants_propagated;
  rate_ = RateLimit{hello->max_rate_hz};
  wants_frames_ = hello->wants_frames;
  for (const std::uint32_t stream : {GEOFLOW_COLOR, GEOFLOW_DEPTH, GEOFLOW_CLOUD}) {
    frames_[stream].rate = rate_;
  }
  geoflow_welcome reply = welcome;
  reply.client_id = id_;
  welcomed_ = send(encode_record(GEOFLOW_WELCOME, 0, sent_, reply)) == Sent::kYes;
  return welcomed_ ? Outcome::kOpen : Outcome::kLost;
}

void PoseConnection::refuse(geoflow_refusal reason, const std::string& text) {
  geoflow_refuse record{};
  record.reason = reason;
  copy_text(record.text, text);
  (void)send(encode_record(GEOFLOW_REFUSE, 0, sent_, record));
  // Unread data at close() would turn the refusal into ECONNRESET at the client.
  ::shutdown(fd(), SHUT_RD);
  std::array<std::byte, GEOFLOW_MAX_RECORD> discarded{};
  for (int i = 0;
       i < kReceivesAtOnce && ::recv(fd(), discarded.data(), discarded.size(), MSG_DONTWAIT) > 0;
       ++i) {
  }
}

PoseConnection::Outcome PoseConnection::offer(const geoflow_pose& pose, HostTime now) {
  if (!welcomed_ || !wants(pose) || ending_ || !rate_.due(now)) {
    return Outcome::kOpen;
  }
  newest_capture_ns_ = std::max(newest_capture_ns_, pose.t_capture_ns);
  if (pending_) {
    ++dropped_;
    ++dropped_since_last_;
    pending_ = pose;
    return Outcome::kOpen;
  }
  const Sent result = send_pose(pose);
  if (result == Sent::kFull) {
    pending_ = pose;
    waiting_since_ = now;
  }
  return result == Sent::kBroken ? Outcome::kLost : Outcome::kOpen;
}

PoseConnection::Outcome PoseConnection::offer(const StreamedFrame& streamed, HostTime now) {
  if (!welcomed_ || ending_ || (wants_frames_ & want_of(streamed.frame.stream)) == 0) {
    return Outcome::kOpen;
  }
  FrameStream& stream = frames_[streamed.frame.stream];
  if (!stream.rate.due(now)) {
    return Outcome::kOpen;
  }
  const Sent result = send_frame(streamed, stream);
  if (result == Sent::kFull) {
    ++dropped_;
    ++stream.dropped_since_last;
    waiting_since_ = blocked() ? waiting_since_ : now;
    starved_ = true;
  }
  return result == Sent::kBroken ? Outcome::kLost : Outcome::kOpen;
}

PoseConnection::Sent PoseConnection::send_frame(const StreamedFrame& streamed,
                                                FrameStream& stream) {
  if (stream.ring != streamed.ring.ring) {
    const Sent result = send(encode_record(GEOFLOW_RING, 0, sent_, streamed.ring), streamed.fd);
    if (result != Sent::kYes) {
      return result;
    }
    stream.ring = streamed.ring.ring;
  }
  const Sent result =
      send(encode_record(GEOFLOW_FRAME, stream.dropped_since_last, sent_, streamed.frame));
  if (result == Sent::kYes) {
    stream.dropped_since_last = 0;
  }
  return result;
}

bool PoseConnection::wants(const geoflow_pose& pose) const noexcept {
  if (is_propagated(pose)) {
    return wants_propagated_;
  }
  return wants_pose_ || (wants_propagated_ && pose.t_capture_ns > newest_capture_ns_);
}

PoseConnection::Outcome PoseConnection::flush(HostTime now) {
  if (pending_) {
    const Sent result = send_pose(*pending_);
    if (result != Sent::kYes) {
      return result == Sent::kBroken ? Outcome::kLost : Outcome::kOpen;
    }
    pending_.reset();
    waiting_since_ = now;
  }
  starved_ = false;  // there is room for the next one
  return ending_ ? send_end(*ending_) : Outcome::kOpen;
}

PoseConnection::Outcome PoseConnection::finish(geoflow_end_reason reason, HostTime now) {
  if (!welcomed_) {
    return Outcome::kFinished;
  }
  if (!blocked()) {
    waiting_since_ = now;
  }
  ending_ = reason;
  return pending_ ? Outcome::kOpen : send_end(reason);
}

PoseConnection::Outcome PoseConnection::send_end(geoflow_end_reason reason) {
  const geoflow_end record{.reason = static_cast<std::uint32_t>(reason), .reserved = 0};
  const Sent result = send(encode_record(GEOFLOW_END, 0, sent_, record));
  ended_ = result == Sent::kYes;
  return result == Sent::kFull ? Outcome::kOpen : Outcome::kFinished;
}

PoseConnection::Sent PoseConnection::send_pose(const geoflow_pose& pose) {
  const Sent result = send(encode_record(GEOFLOW_POSE, dropped_since_last_, sent_, pose));
  if (result == Sent::kYes) {
    dropped_since_last_ = 0;
  }
  return result;
}

PoseConnection::Sent PoseConnection::send(std::span<const std::byte> record, int passed) {
  iovec part{.iov_base = const_cast<std::byte*>(record.data()),  // NOLINT: sendmsg() only reads it
             .iov_len = record.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof passed)> control{};
  if (passed >= 0) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* const header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof passed);
    std::memcpy(CMSG_DATA(header), &passed, sizeof passed);
  }
  const ssize_t size = ::sendmsg(fd(), &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (size >= 0) {
    ++sent_;
    return Sent::kYes;
  }
  return errno == EAGAIN || errno == EINTR ? Sent::kFull : Sent::kBroken;
}

}  // namespace geoflow::daemon
