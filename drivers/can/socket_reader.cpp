#include "can/socket_reader.hpp"

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <optional>
#include <span>
#include <system_error>
#include <vector>

#include <linux/can.h>
#include <sys/socket.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"

namespace geoflow::drivers::can {
namespace {

/// Of an FD frame's flags those that are on the wire: newer kernels add CANFD_FDF to each.
constexpr unsigned kWireFlags = CANFD_BRS | CANFD_ESI;

/// A kernel stamp older than this is not believed: the system's clock was set meanwhile.
constexpr Duration kOldestStamp = std::chrono::seconds{1};

/// What the kernel tells beside a frame.
struct Beside {
  std::optional<timespec> stamp;
  std::optional<std::uint32_t> drops;
};

template <typename T>
std::optional<T> value_of(const cmsghdr& control) {
  if (control.cmsg_len < CMSG_LEN(sizeof(T))) {
    return std::nullopt;
  }
  T value{};
  std::memcpy(&value, CMSG_DATA(&control), sizeof(T));
  return value;
}

Beside read_beside(msghdr& message) {
  Beside beside;
  for (cmsghdr* control = CMSG_FIRSTHDR(&message); control != nullptr;
       control = CMSG_NXTHDR(&message, control)) {
    if (control->cmsg_level != SOL_SOCKET) {
      continue;
    }
    if (control->cmsg_type == SCM_TIMESTAMPNS) {
      beside.stamp = value_of<timespec>(*control);
    } else if (control->cmsg_type == SO_RXQ_OVFL) {
      beside.drops = value_of<std::uint32_t>(*control);
    }
  }
  return beside;
}

/// When a frame arrived, on CLOCK_MONOTONIC: its age by the clock of the stamp, before now.
HostTime arrival_of(const std::optional<timespec>& stamp) {
  const HostTime now = HostClock::now();
  if (!stamp) {
    return now;
  }
  const Duration stamped =
      std::chrono::seconds{stamp->tv_sec} + std::chrono::nanoseconds{stamp->tv_nsec};
  const Duration age = std::chrono::system_clock::now().time_since_epoch() - stamped;
  return age >= Duration::zero() && age <= kOldestStamp ? now - age : now;
}

}  // namespace

std::optional<Frame> from_kernel(std::span<const std::byte> bytes) noexcept {
  const bool fd = bytes.size() == sizeof(canfd_frame);
  if (!fd && bytes.size() != sizeof(can_frame)) {
    return std::nullopt;
  }
  // Both begin alike: identifier, length, flags; data at byte 8.
  canfd_frame raw{};
  std::memcpy(&raw, bytes.data(), bytes.size());
  if (raw.len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
    return std::nullopt;
  }
  Frame frame{.error = (raw.can_id & CAN_ERR_FLAG) != 0,
              .fd = fd,
              .fd_flags = static_cast<std::uint8_t>(fd ? raw.flags & kWireFlags : 0)};
  frame.extended = !frame.error && (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended || frame.error ? CAN_EFF_MASK : CAN_SFF_MASK);
  if (!frame.remote) {
    frame.length = raw.len;
    std::memcpy(frame.data.data(), raw.data, raw.len);
  }
  return frame;
}

KernelFrame to_kernel(const Frame& frame) noexcept {
  canfd_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) |
               (frame.remote ? CAN_RTR_FLAG : 0U) | (frame.error ? CAN_ERR_FLAG : 0U);
  raw.len = frame.length;
  raw.flags = frame.fd ? frame.fd_flags : std::uint8_t{0};
  std::memcpy(raw.data, frame.data.data(), frame.length);
  KernelFrame kernel{.size = frame.fd ? sizeof(canfd_frame) : sizeof(can_frame)};
  std::memcpy(kernel.bytes.data(), &raw, kernel.size);
  return kernel;
}

SocketReader::SocketReader() {
  for (std::size_t i = 0; i < kBatch; ++i) {
    vectors_[i] = {.iov_base = buffers_[i].data(), .iov_len = buffers_[i].size()};
    messages_[i].msg_hdr.msg_iov = &vectors_[i];
    messages_[i].msg_hdr.msg_iovlen = 1;
    messages_[i].msg_hdr.msg_control = controls_[i].bytes.data();
  }
}

Result<void> SocketReader::read(int fd, std::uint8_t bus, std::vector<Received>& frames) {
  while (true) {
    for (mmsghdr& message : messages_) {
      message.msg_hdr.msg_controllen = kControlBytes;
      message.msg_hdr.msg_flags = 0;
    }
    const int count = ::recvmmsg(fd, messages_.data(), kBatch, MSG_DONTWAIT, nullptr);
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      const int error = errno;
      return error == EAGAIN
                 ? Result<void>{}
                 : fail(ErrorCode::kUnavailable, "{}", std::generic_category().message(error));
    }
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      take(messages_[i].msg_hdr, messages_[i].msg_len, bus, frames);
    }
    if (static_cast<std::size_t>(count) < kBatch) {
      return {};
    }
  }
}

void SocketReader::take(msghdr& message, std::size_t size, std::uint8_t bus,
                        std::vector<Received>& frames) {
  const Beside beside = (message.msg_flags & MSG_CTRUNC) == 0 ? read_beside(message) : Beside{};
  if (beside.drops) {
    overflowed_ += static_cast<std::uint32_t>(*beside.drops - queue_drops_);
    queue_drops_ = *beside.drops;
  }
  const bool whole = (message.msg_flags & MSG_TRUNC) == 0;
  const auto* const bytes = static_cast<const std::byte*>(message.msg_iov->iov_base);
  const auto frame = whole ? from_kernel({bytes, size}) : std::nullopt;
  if (!frame) {
    ++malformed_;
    return;
  }
  frames.push_back({.frame = *frame, .t_arrival = arrival_of(beside.stamp), .bus = bus});
}

}  // namespace geoflow::drivers::can
