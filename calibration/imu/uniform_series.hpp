#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::calibration {

/// The axes of an IMU in the order of all tables here: accelerometer x, y, z, gyroscope x, y, z.
inline constexpr std::size_t kImuAxes = 6;

/// A piece of a recording without a long gap, one value a period on each axis. Short gaps are
/// filled on a straight line.
struct UniformSeries {
  HostTime begin;                                    ///< of the first sample
  std::array<std::vector<double>, kImuAxes> axes{};  ///< equally long [m/s^2], [rad/s]
  std::vector<bool> filled{};                        ///< as long: not measured

  [[nodiscard]] std::size_t size() const noexcept { return filled.size(); }
};

/// What an IMU said, on a regular time line.
struct UniformRecording {
  double period_s = 0;  ///< the median interval
  std::vector<UniformSeries> pieces;
};

/// Splits samples at gaps of more than `kLongestGap` periods. Pure. Errors (kInvalidData): fewer
/// than two samples, a value that is no number, stamps that do not grow; the sample's number is
/// named.
[[nodiscard]] Result<UniformRecording> make_uniform(std::span<const Timed<ImuSample>> samples);

/// Samples that may be missing in a row before a series ends.
inline constexpr std::size_t kLongestGap = 10;

}  // namespace geoflow::calibration
