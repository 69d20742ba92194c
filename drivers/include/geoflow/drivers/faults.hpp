#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// Faults that a script put on a recording, as counted while it was replayed
/// (docs/fault-scripts.md).
namespace geoflow::drivers {

/// One stream of samples of a recording.
enum class StreamId : std::uint8_t { kColor, kDepth, kImu, kLegs, kBodyVelocity };
inline constexpr std::size_t kStreamCount = 5;

enum class FaultKind : std::uint8_t {
  kDrop,         ///< the sample never arrives
  kDelay,        ///< it arrives later
  kDuplicate,    ///< it arrives twice
  kReorder,      ///< it arrives after its successor
  kStuck,        ///< it repeats the last good value under its own stamp
  kNan,          ///< its numbers are not numbers
  kGap,          ///< the whole stream is silent for a while
  kClockOffset,  ///< its device clock is off by a constant
  kClockDrift,   ///< its device clock runs fast or slow
  kClockJump,    ///< its device clock steps once
  kClockWrap,    ///< its device clock is a 32-bit counter of microseconds
  kTruncate,     ///< its encoded image ends early
  kCover,        ///< the lens is covered: black colour, no depth
};
inline constexpr std::size_t kFaultKindCount = 13;

/// The name used in fault scripts and reports: `drop`, `clock_wrap`, … Thread-safe.
[[nodiscard]] std::string_view name(FaultKind kind) noexcept;

/// The name used in fault scripts and reports: `color`, `body_velocity`, … Thread-safe.
[[nodiscard]] std::string_view name(StreamId stream) noexcept;

/// How many samples each kind of fault touched, by stream. A wrap counts each time the counter
/// starts again from 0, a clock offset, drift or jump each sample that it shifted.
struct FaultCounters {
  std::array<std::array<std::uint64_t, kStreamCount>, kFaultKindCount> counts{};

  [[nodiscard]] std::uint64_t& of(FaultKind kind, StreamId stream) noexcept {
    return counts[static_cast<std::size_t>(kind)][static_cast<std::size_t>(stream)];
  }
  [[nodiscard]] std::uint64_t of(FaultKind kind, StreamId stream) const noexcept {
    return counts[static_cast<std::size_t>(kind)][static_cast<std::size_t>(stream)];
  }
};

}  // namespace geoflow::drivers
