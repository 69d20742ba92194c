#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

/// Recorded streams behind the same ports as devices.
namespace geoflow::drivers {

/// Which topics and frames of a rosbag2 recording carry what. An empty name: not wanted.
struct TopicNames {
  std::string color = "/camera/color/image_raw";
  std::string depth = "/camera/aligned_depth_to_color/image_raw";
  std::string camera_info = "/camera/color/camera_info";
  std::string imu = "/camera/imu";
  std::string legs = "/joint_foot";      ///< sensor_msgs/JointState: 12 joints, then 4 foot forces
  std::string odometry = "/robot_odom";  ///< nav_msgs/Odometry: its twist is the body velocity
  std::string base_frame = "base_link";  ///< frame_id in /tf_static
};

struct RecordingOptions {
  std::filesystem::path path;  ///< the recording's directory (or file, where a format is one file)
  /// A folder with Kalibr files; none: the recording's own folder, then what the recording itself
  /// says.
  std::optional<std::filesystem::path> calibration{};
  TopicNames topics{};
  std::optional<std::filesystem::path> faults{};  ///< a fault script (docs/fault-scripts.md)
  std::uint64_t fault_seed = 0;
  /// Colour images are decoded to kGray8 (cheaper for JPEG, and what the estimator wants); else to
  /// kBgr8.
  bool color_as_gray = false;
  /// Samples decoded ahead of delivery on a thread of their own.
  std::size_t prefetch = 8;
};

/// One stream found in a recording.
struct StreamSummary {
  std::string name;  ///< topic or list file
  std::string type;  ///< `color`, `depth`, `imu`, … or the message type
  std::uint64_t count = 0;
};

struct RecordingInfo {
  std::string format;  ///< `tum`, `rosbag2`, `openloris`, `euroc`
  HostTime start;      ///< stamp of the first sample, on the recording's time line
  HostTime end;        ///< stamp of the last sample
  std::vector<StreamSummary> streams;
};

}  // namespace geoflow::drivers
