#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <optional>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::slam {

/// What an IMU said during a time in which the robot did not move.
struct StillInterval {
  Vector3d gyro_radps = Vector3d::Zero();  ///< mean
  Duration duration{};
};

/// Zero velocity: for a window of 0.3 s no joint has turned by more than a sensor's step or two,
/// and the IMU has been quiet and has not turned beyond what its noise and bias explain. It does
/// not ask for contact: a robot that lies is still as well. Without legs it is the IMU alone. A
/// walking robot's joints turn by some 0.3 rad in any such window. Thread-compatible.
class StillnessDetector {
 public:
  explicit StillnessDetector(const ImuNoise& noise) : noise_{noise} {}

  void add(HostTime t, const ImuSample& sample);
  void add(HostTime t, const LegSample& sample);

  /// The window that ends with the newest sample, if it was still. `bias_gyro`: as believed.
  [[nodiscard]] std::optional<StillInterval> still(const Vector3d& bias_gyro) const;

 private:
  [[nodiscard]] bool joints_rest() const;

  ImuNoise noise_;
  std::deque<Timed<ImuSample>> imu_;
  std::deque<Timed<LegSample>> legs_;
};

}  // namespace geoflow::slam
