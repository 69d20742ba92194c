#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/time.hpp"

/// Controller Area Network as it is seen on a bus: frames and when they came.
namespace geoflow::drivers::can {

inline constexpr std::size_t kClassicBytes = 8;  ///< payload of a classic frame at most (ISO 11898)
inline constexpr std::size_t kFdBytes = 64;      ///< payload of a CAN FD frame at most

/// One frame, classic or FD, or an error report of the controller.
struct Frame {
  std::uint32_t id = 0;   ///< 11 bits, or 29 where `extended`; of an error report its class bits
  bool extended = false;  ///< identifier of 29 bits
  bool remote = false;    ///< a request for data, without data
  bool error = false;     ///< no frame of the bus: linux/can/error.h says what id and data mean
  bool fd = false;
  std::uint8_t fd_flags = 0;  ///< CANFD_BRS (1) and CANFD_ESI (2) as on the wire; FD only
  std::uint8_t length = 0;    ///< payload bytes, at most kClassicBytes or kFdBytes
  std::array<std::byte, kFdBytes> data{};  ///< zero beyond `length`

  [[nodiscard]] std::span<const std::byte> payload() const noexcept {
    return std::span{data}.first(length);
  }
  friend bool operator==(const Frame&, const Frame&) = default;
};

/// A frame and its arrival at this host.
struct Received {
  Frame frame;
  HostTime t_arrival;
  std::uint8_t bus{};  ///< which of the interfaces that are read, in the order they were named
};

}  // namespace geoflow::drivers::can
