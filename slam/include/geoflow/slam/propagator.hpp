#pragma once

#include <memory>
#include <optional>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"

namespace geoflow::slam {

/// Carries the newest frame's estimate on to the newest IMU sample, by IMU and legs: a pose as
/// often as the IMU speaks, without the time that a frame takes.
///
/// Dead reckoning (slam/legs) runs beside the estimator on every sample as it comes, and remembers
/// the last second. A frame's estimate is for a time in that second: what was reckoned since then
/// is put behind it, so that a new estimate moves the output by nothing but its own correction.
///
/// - With legs or a robot's own odometry, the way is dead reckoning's.
/// - With the IMU alone, the frame's velocity is integrated on by the accelerometer, as dead
///   reckoning has levelled it.
///
/// Covariances grow as reckoning's turn and velocity are uncertain, taken to last. Deterministic:
/// the output depends on the order of the calls alone. Thread-compatible.
class Propagator {
 public:
  /// None where the IMU's place on the camera is not known, or the IMU is switched off.
  [[nodiscard]] static std::unique_ptr<Propagator> create(const Calibration& calibration,
                                                          const Switches& switches);
  Propagator(const Propagator&) = delete;
  Propagator& operator=(const Propagator&) = delete;
  ~Propagator();

  /// Samples by stream in the order of their times; others are ignored. A leg sample that comes
  /// more than a few milliseconds after the IMU's of its time still counts.
  void add(const Timed<LegSample>& sample);
  void add(const Timed<BodyVelocitySample>& sample);

  /// The pose at an IMU sample. None before the first frame's estimate, before dead reckoning has
  /// started, and while the frame is later than all samples.
  [[nodiscard]] std::optional<PoseEstimate> add(const Timed<ImuSample>& sample);

  /// Of the frame that the last pose goes back to.
  [[nodiscard]] HostTime frame_time() const noexcept;

  /// A frame's estimate. One that is older than the last second, or no pose, is ignored.
  void correct(const PoseEstimate& frame);

 private:
  class Impl;
  explicit Propagator(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace geoflow::slam
