#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

/// The robot's pose and health for machines that run ROS 2, over DDS, without ROS (docs/ros.md).
namespace geoflow::drivers {

struct RosPublisherOptions {
  std::string
      interface{};     ///< name of a network interface; empty: what CYCLONEDDS_URI says, or any
  int domain = 0;      ///< ROS_DOMAIN_ID of the others
  std::string name{};  ///< ROS namespace of the topics, `dog1` or `site/dog1`; empty: none
  std::string map_frame = "map";
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
};

/// A pose as nav_msgs/Odometry and tf have it. Covariances: order (x, y, z, rotation about x, y,
/// z).
struct RosPose {
  Duration t{};  ///< since 1970
  SE3 T_map_odom;
  SE3 T_odom_base;
  Vector3d v_base = Vector3d::Zero();            ///< of base, in base [m/s]
  Vector3d w_base = Vector3d::Zero();            ///< of base, in base [rad/s]
  Matrix6d pose_covariance = Matrix6d::Zero();   ///< along and about odom's axes
  Matrix6d twist_covariance = Matrix6d::Zero();  ///< along and about base's axes
};

/// One entry of diagnostic_msgs/DiagnosticArray.
struct RosDiagnostic {
  enum class Level : std::uint8_t { kOk, kWarn, kError, kStale };  ///< the message's own numbers
  Level level = Level::kOk;
  std::string name;
  std::string message;
  std::vector<std::pair<std::string, std::string>> values{};
};

/// Writes the topics `odom` (nav_msgs/Odometry), `tf` (tf2_msgs/TFMessage) and `diagnostics`
/// (diagnostic_msgs/DiagnosticArray) in the namespace `name`, with ROS 2's default quality of
/// service: reliable, volatile, the last 10 (tf: 100). Thread-bound. A reader that does not keep up
/// can hold a write for up to 100 ms.
class RosPublisher {
 public:
  /// What is no ROS 2 namespace or frame: kInvalidArgument, naming the key of the configuration's
  /// section `ros`. Pure.
  [[nodiscard]] static Result<void> check(const RosPublisherOptions& options);
  /// Joins the network. Errors: kUnsupported for a program that was built without DDS; kNotFound
  /// for an interface that is not there, kInvalidArgument where this process has the domain on
  /// another interface, kUnavailable.
  [[nodiscard]] static Result<std::unique_ptr<RosPublisher>> open(
      const RosPublisherOptions& options);

  RosPublisher() = default;
  RosPublisher(const RosPublisher&) = delete;
  RosPublisher& operator=(const RosPublisher&) = delete;
  virtual ~RosPublisher() = default;

  /// On `odom`, and on `tf` map -> odom and odom -> base. Errors: kUnavailable.
  [[nodiscard]] virtual Result<void> write(const RosPose& pose) = 0;
  /// On `diagnostics`; `t` since 1970. Errors: kUnavailable.
  [[nodiscard]] virtual Result<void> write(std::span<const RosDiagnostic> diagnostics,
                                           Duration t) = 0;
  /// Readers of `odom` that are known now.
  [[nodiscard]] virtual std::uint32_t readers() const = 0;
};

}  // namespace geoflow::drivers
