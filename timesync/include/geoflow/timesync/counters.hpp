#pragma once

#include <cstdint>

#include "geoflow/timesync/clock_fit.hpp"

namespace geoflow::timesync {

/// What became of one stream's samples. Never decreases. Every pushed sample has exactly one fate:
/// pushed == used + unused + late + duplicate + invalid + outlier + overflow + those still waiting.
struct StreamCounters {
  std::uint64_t pushed = 0;
  std::uint64_t used = 0;  ///< went into at least one packet
  std::uint64_t unused =
      0;  ///< no packet wanted it: a depth frame without colour, samples after the last packet
  std::uint64_t late = 0;       ///< came after the packet that it belonged to
  std::uint64_t duplicate = 0;  ///< another sample of the same instant came first
  std::uint64_t invalid = 0;    ///< not finite, no image, or an absurd stamp
  std::uint64_t outlier = 0;    ///< far in the stream's future, and the next sample did not agree
  std::uint64_t overflow = 0;   ///< the oldest of a full buffer

  std::uint64_t reordered = 0;  ///< not a fate: came after a newer one and was put in its place
  std::uint64_t silences =
      0;  ///< not a fate: times that the stream went silent and was no longer waited for

  /// Samples whose fate is decided.
  [[nodiscard]] std::uint64_t settled() const noexcept {
    return used + unused + late + duplicate + invalid + outlier + overflow;
  }
};

/// All counters of a Synchroniser.
struct SynchroniserCounters {
  StreamCounters color;
  StreamCounters depth;
  StreamCounters imu;
  StreamCounters legs;
  StreamCounters body_velocity;
  ClockCounters camera_clock;  ///< these stay zero for StampDomain::kHost
  ClockCounters imu_clock;
  ClockCounters leg_clock;
  std::uint64_t packets = 0;
  std::uint64_t blind = 0;          ///< packets without images, while colour was silent
  std::uint64_t depth_missing = 0;  ///< packets with colour, without depth
  std::uint64_t depth_shared = 0;   ///< packets whose depth had been used before
  std::uint64_t wait_expired = 0;  ///< packets that went out incomplete because their wait was over
};

}  // namespace geoflow::timesync
