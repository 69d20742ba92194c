#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

/// The standard ROS 2 messages that recordings are made of, field for field and name for name as
/// their .msg files say (github.com/ros2/common_interfaces, rcl_interfaces and geometry2).
///
/// `fields(message)` lists a message's members in wire order, as references; reading, writing and
/// tests walk that one list. `kType` is the name under which a bag stores the message. Units and
/// frames are REP-103's: m, rad, s, N.
namespace geoflow::drivers::ros {

/// The bytes of an image. A view: of the message they were decoded from, or of the pixels that are
/// to be written.
using Bytes = std::span<const std::byte>;

using Matrix3 = std::array<double, std::size_t{3} * 3>;   ///< row by row
using Matrix34 = std::array<double, std::size_t{3} * 4>;  ///< row by row
using Covariance6 =
    std::array<double, std::size_t{6} * 6>;  ///< row by row; (x, y, z, rotation about x, y, z)

/// builtin_interfaces/Time.
struct Time {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  static auto fields(auto& m) { return std::tie(m.sec, m.nanosec); }
};

struct Header {
  static constexpr std::string_view kType = "std_msgs/msg/Header";
  Time stamp;
  std::string frame_id;
  static auto fields(auto& m) { return std::tie(m.stamp, m.frame_id); }
};

struct Image {
  static constexpr std::string_view kType = "sensor_msgs/msg/Image";
  Header header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string encoding;
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;  ///< bytes a row
  Bytes data;
  static auto fields(auto& m) {
    return std::tie(m.header, m.height, m.width, m.encoding, m.is_bigendian, m.step, m.data);
  }
};

struct CompressedImage {
  static constexpr std::string_view kType = "sensor_msgs/msg/CompressedImage";
  Header header;
  std::string format;
  Bytes data;
  static auto fields(auto& m) { return std::tie(m.header, m.format, m.data); }
};

struct RegionOfInterest {
  std::uint32_t x_offset = 0;
  std::uint32_t y_offset = 0;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  bool do_rectify = false;
  static auto fields(auto& m) {
    return std::tie(m.x_offset, m.y_offset, m.height, m.width, m.do_rectify);
  }
};

struct CameraInfo {
  static constexpr std::string_view kType = "sensor_msgs/msg/CameraInfo";
  Header header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string distortion_model;
  std::vector<double> d;
  Matrix3 k{};
  Matrix3 r{};
  Matrix34 p{};
  std::uint32_t binning_x = 0;
  std::uint32_t binning_y = 0;
  RegionOfInterest roi;
  static auto fields(auto& m) {
    return std::tie(m.header, m.height, m.width, m.distortion_model, m.d, m.k, m.r, m.p,
                    m.binning_x, m.binning_y, m.roi);
  }
};

/// geometry_msgs/Vector3 and Point.
struct Vector3 {
  double x = 0;
  double y = 0;
  double z = 0;
  static auto fields(auto& m) { return std::tie(m.x, m.y, m.z); }
};

struct Quaternion {
  double x = 0;
  double y = 0;
  double z = 0;
  double w = 1;
  static auto fields(auto& m) { return std::tie(m.x, m.y, m.z, m.w); }
};

struct Imu {
  static constexpr std::string_view kType = "sensor_msgs/msg/Imu";
  Header header;
  Quaternion orientation;
  Matrix3 orientation_covariance{};  ///< first element -1: no orientation in this message
  Vector3 angular_velocity;          ///< [rad/s]
  Matrix3 angular_velocity_covariance{};
  Vector3 linear_acceleration;  ///< [m/s^2]
  Matrix3 linear_acceleration_covariance{};
  static auto fields(auto& m) {
    return std::tie(m.header, m.orientation, m.orientation_covariance, m.angular_velocity,
                    m.angular_velocity_covariance, m.linear_acceleration,
                    m.linear_acceleration_covariance);
  }
};

struct JointState {
  static constexpr std::string_view kType = "sensor_msgs/msg/JointState";
  Header header;
  std::vector<std::string> name;
  std::vector<double> position;
  std::vector<double> velocity;
  std::vector<double> effort;
  static auto fields(auto& m) {
    return std::tie(m.header, m.name, m.position, m.velocity, m.effort);
  }
};

struct Pose {
  Vector3 position;
  Quaternion orientation;
  static auto fields(auto& m) { return std::tie(m.position, m.orientation); }
};

struct PoseWithCovariance {
  Pose pose;
  Covariance6 covariance{};
  static auto fields(auto& m) { return std::tie(m.pose, m.covariance); }
};

struct Twist {
  Vector3 linear;
  Vector3 angular;
  static auto fields(auto& m) { return std::tie(m.linear, m.angular); }
};

struct TwistWithCovariance {
  Twist twist;
  Covariance6 covariance{};
  static auto fields(auto& m) { return std::tie(m.twist, m.covariance); }
};

struct Odometry {
  static constexpr std::string_view kType = "nav_msgs/msg/Odometry";
  Header header;
  std::string child_frame_id;
  PoseWithCovariance pose;    ///< of the child frame in the header's frame
  TwistWithCovariance twist;  ///< expressed in the child frame
  static auto fields(auto& m) { return std::tie(m.header, m.child_frame_id, m.pose, m.twist); }
};

struct Transform {
  Vector3 translation;
  Quaternion rotation;
  static auto fields(auto& m) { return std::tie(m.translation, m.rotation); }
};

/// T_frame_child with frame = header.frame_id.
struct TransformStamped {
  Header header;
  std::string child_frame_id;
  Transform transform;
  static auto fields(auto& m) { return std::tie(m.header, m.child_frame_id, m.transform); }
};

struct TfMessage {
  static constexpr std::string_view kType = "tf2_msgs/msg/TFMessage";
  std::vector<TransformStamped> transforms;
  static auto fields(auto& m) { return std::tie(m.transforms); }
};

}  // namespace geoflow::drivers::ros
