#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/config.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/gicp.hpp"
#include "odometry/frame.hpp"
#include "odometry/tracker.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam::tests {

/// The images of a TUM recording in memory, with its true camera poses, and its places as the
/// estimator sees them. A mirrored image is of a place that does not exist: it looks just like the
/// recording, but no rigid motion makes one of the other.
class RecordedPlaces {
 public:
  /// The first `count` images; a failed assertion where there are fewer. `path` has
  /// groundtruth.txt.
  RecordedPlaces(const std::filesystem::path& path, std::size_t count);

  [[nodiscard]] std::size_t size() const noexcept { return color_.size(); }
  [[nodiscard]] const Calibration& calibration() const noexcept { return calibration_; }
  [[nodiscard]] CameraModel camera() const { return CameraModel{calibration_.camera}; }
  /// True pose of the camera, in the reference's world.
  [[nodiscard]] const SE3& reference(std::size_t i) const { return reference_[i].pose; }

  /// What a synchroniser would make of the images, 30 of them a second.
  [[nodiscard]] SyncedPacket packet(std::size_t i) const { return packet(i, color_[i], depth_[i]); }
  [[nodiscard]] SyncedPacket packet_mirrored(std::size_t i) const;

  /// A frame with pyramid, cloud and place, at the identity.
  [[nodiscard]] Frame look(std::size_t i) { return look(color_[i], depth_[i]); }
  [[nodiscard]] Frame look_mirrored(std::size_t i);

  [[nodiscard]] const Config& config() const noexcept { return config_; }
  [[nodiscard]] const GicpConfig& gicp() const noexcept { return gicp_; }

 private:
  [[nodiscard]] static SyncedPacket packet(std::size_t i, const FrameRef& color,
                                           const FrameRef& depth);
  [[nodiscard]] Frame look(const FrameRef& color, const FrameRef& depth);

  Config config_;
  GicpConfig gicp_;
  Calibration calibration_;
  std::vector<FrameRef> color_;
  std::vector<FrameRef> depth_;
  Trajectory reference_;
  std::unique_ptr<Tracker> tracker_;
  OrbExtractor orb_{config_.features};
};

}  // namespace geoflow::slam::tests
