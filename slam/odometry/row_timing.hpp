#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/slam/config.hpp"

#include "odometry/frame.hpp"
#include "odometry/pose_optimiser.hpp"
#include "vision/camera_model.hpp"
#include "vision/row_time.hpp"

namespace geoflow::slam {

/// How the camera moves while an image is read out, and how long that takes. It needs a gyroscope:
/// a turn guessed from the frames before lags behind a trot. Thread-compatible.
class RowTiming {
 public:
  RowTiming(const Switches& switches, const Calibration& calibration);

  /// Takes the next frame's samples.
  void begin_frame(const SyncedPacket& packet);

  /// The frame's motion, given the one before and where it is expected to be. None where it is not
  /// known.
  [[nodiscard]] std::optional<RowMotion> motion(const Frame& previous, HostTime t,
                                                const SE3& T_odom_cam_predicted) const;

  /// Learns from a frame's solution; `feature_of_match`: indices into its features.
  void learn(const Frame& frame, std::span<const VisualMatch> matches,
             const std::vector<std::size_t>& feature_of_match, const PoseSolution& solution);

  [[nodiscard]] const ReadoutEstimate& readout() const noexcept { return readout_; }

 private:
  CameraModel camera_;
  std::optional<SE3> T_cam_imu_;   ///< none: the gyroscope is not to be used
  std::optional<Vector3d> w_cam_;  ///< of the current frame [rad/s]
  ReadoutEstimate readout_;
};

}  // namespace geoflow::slam
