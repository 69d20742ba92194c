#pragma once

#include <cstddef>
#include <vector>

#include "imu/uniform_series.hpp"

namespace geoflow::calibration {

/// Samples [begin, end) of one piece of a recording, throughout which the IMU stood still.
struct StillStretch {
  std::size_t piece = 0;
  std::size_t begin = 0;
  std::size_t end = 0;

  [[nodiscard]] std::size_t size() const noexcept { return end - begin; }
};

/// All of them, in order of time. It stands still while, over blocks of 0.2 s, the mean rate and
/// specific force stay within 0.015 rad/s and 0.15 m/s^2 of what they were over the ten seconds
/// before (twice to three times what a robot's motors shake), and their scatter within four times
/// that of the quietest block. Blocks in which a motion may have begun or ended are left out. Pure.
[[nodiscard]] std::vector<StillStretch> still_stretches(const UniformRecording& recording);

/// The longest one; of size 0 where there is none. Pure.
[[nodiscard]] StillStretch longest_still(const UniformRecording& recording);

}  // namespace geoflow::calibration
