#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <linux/can.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include "geoflow/hal/result.hpp"

#include "can/frame.hpp"

namespace geoflow::drivers::can {

/// A `can_frame` or `canfd_frame` (linux/can.h) as the kernel hands it over; none if it has
/// neither's size, or says to have more data than fits. Pure.
[[nodiscard]] std::optional<Frame> from_kernel(std::span<const std::byte> bytes) noexcept;

/// The same for sending: `can_frame` or, of an FD frame, `canfd_frame`. Pure.
struct KernelFrame {
  std::array<std::byte, sizeof(canfd_frame)> bytes{};
  std::size_t size = 0;
  [[nodiscard]] std::span<const std::byte> view() const noexcept {
    return std::span{bytes}.first(size);
  }
};
[[nodiscard]] KernelFrame to_kernel(const Frame& frame) noexcept;

/// Takes frames from one socket, many a system call (recvmmsg), each with the kernel's stamp of its
/// arrival (SCM_TIMESTAMPNS, mapped to CLOCK_MONOTONIC; without one: now) and the kernel's count of
/// frames that found the receive queue full (SO_RXQ_OVFL). Thread-bound.
class SocketReader {
 public:
  SocketReader();

  /// Adds all frames that wait in `fd`, which does not block, as of bus number `bus`. What is no
  /// frame is counted. An error is errno's, kUnavailable: the interface is down or gone.
  [[nodiscard]] Result<void> read(int fd, std::uint8_t bus, std::vector<Received>& frames);

  [[nodiscard]] std::uint64_t overflowed() const noexcept { return overflowed_; }
  [[nodiscard]] std::uint64_t malformed() const noexcept { return malformed_; }

 private:
  static constexpr std::size_t kBatch = 64;
  static constexpr std::size_t kControlBytes = 128;

  void take(msghdr& message, std::size_t size, std::uint8_t bus, std::vector<Received>& frames);

  struct alignas(std::max_align_t) Control {
    std::array<std::byte, kControlBytes> bytes{};
  };
  std::array<std::array<std::byte, sizeof(canfd_frame)>, kBatch> buffers_{};
  std::array<Control, kBatch> controls_{};
  std::array<iovec, kBatch> vectors_{};
  std::array<mmsghdr, kBatch> messages_{};
  std::uint32_t queue_drops_ = 0;  // the kernel's running count
  std::uint64_t overflowed_ = 0;
  std::uint64_t malformed_ = 0;
};

}  // namespace geoflow::drivers::can
