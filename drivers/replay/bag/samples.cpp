#include "replay/bag/samples.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/cdr/messages.hpp"

namespace geoflow::drivers::bag {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

Vector3d to_eigen(const ros::Vector3& v) {
  return {v.x, v.y, v.z};
}
ros::Vector3 to_ros(const Vector3d& v) {
  return {.x = v.x(), .y = v.y(), .z = v.z()};
}

constexpr const char* kPlumbBob = "plumb_bob";
constexpr const char* kEquidistant = "equidistant";
constexpr const char* kRational = "rational_polynomial";

/// Where K holds what.
constexpr std::size_t kFx = 0;
constexpr std::size_t kCx = 2;
constexpr std::size_t kFy = 4;
constexpr std::size_t kCy = 5;

}  // namespace

Result<Duration> to_duration(const ros::Time& stamp) {
  if (stamp.nanosec >= kNanosecondsPerSecond) {
    return fail(ErrorCode::kInvalidData, "a stamp has {} ns beside its seconds", stamp.nanosec);
  }
  return Duration{stamp.sec * kNanosecondsPerSecond + stamp.nanosec};
}

Result<ros::Time> to_stamp(Duration since_epoch) {
  const std::int64_t ns = since_epoch.count();
  const std::int64_t rest = ns % kNanosecondsPerSecond;  // of the sign of ns
  const std::int64_t nanosec = rest < 0 ? rest + kNanosecondsPerSecond : rest;
  const std::int64_t sec = ns / kNanosecondsPerSecond - (rest < 0 ? 1 : 0);
  if (sec < std::numeric_limits<std::int32_t>::min() ||
      sec > std::numeric_limits<std::int32_t>::max()) {
    return fail(ErrorCode::kInvalidArgument, "a stamp of {} s is beyond the 32 bits of a ROS stamp",
                sec);
  }
  return ros::Time{.sec = static_cast<std::int32_t>(sec),
                   .nanosec = static_cast<std::uint32_t>(nanosec)};
}

ImuSample to_sample(const ros::Imu& message) {
  return {.accel_mps2 = to_eigen(message.linear_acceleration),
          .gyro_radps = to_eigen(message.angular_velocity)};
}

ros::Imu to_message(const ImuSample& sample) {
  ros::Imu message;
  message.orientation_covariance[0] = -1.0;
  message.angular_velocity = to_ros(sample.gyro_radps);
  message.linear_acceleration = to_ros(sample.accel_mps2);
  return message;
}

BodyVelocitySample to_sample(const ros::Odometry& message) {
  return {.v_base_mps = to_eigen(message.twist.twist.linear),
          .w_base_radps = to_eigen(message.twist.twist.angular)};
}

ros::Odometry to_message(const BodyVelocitySample& sample) {
  ros::Odometry message;
  message.twist.twist = {.linear = to_ros(sample.v_base_mps),
                         .angular = to_ros(sample.w_base_radps)};
  return message;
}

Result<CameraIntrinsics> to_intrinsics(const ros::CameraInfo& message) {
  constexpr std::uint32_t kLargestSide = 1U << 16U;
  if (message.width == 0 || message.height == 0 || message.width > kLargestSide ||
      message.height > kLargestSide) {
    return fail(ErrorCode::kInvalidData, "camera_info: {} x {} pixels", message.width,
                message.height);
  }
  CameraIntrinsics camera{.width = static_cast<int>(message.width),
                          .height = static_cast<int>(message.height),
                          .fx = message.k[kFx],
                          .fy = message.k[kFy],
                          .cx = message.k[kCx],
                          .cy = message.k[kCy]};
  const bool positive = camera.fx > 0 && camera.fy > 0;
  if (!positive || !std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy)) {
    return fail(ErrorCode::kInvalidData,
                "camera_info: K has no focal length (an uncalibrated camera)");
  }
  bool distorted = false;
  for (std::size_t i = 0; i < message.d.size(); ++i) {
    if (i < camera.distortion.size()) {
      camera.distortion[i] = message.d[i];
    } else if (message.d[i] != 0.0) {
      return fail(ErrorCode::kUnsupported,
                  "camera_info: distortion model '{}' with {} coefficients",
                  message.distortion_model, message.d.size());
    }
    distorted = distorted || message.d[i] != 0.0;
  }
  if (!distorted) {
    return camera;
  }
  if (message.distortion_model == kEquidistant) {
    camera.model = DistortionModel::kEquidistant;
  } else if (message.distortion_model == kPlumbBob || message.distortion_model == kRational) {
    camera.model = DistortionModel::kRadtan;
  } else {
    return fail(ErrorCode::kUnsupported, "camera_info: distortion model '{}'",
                message.distortion_model);
  }
  return camera;
}

ros::CameraInfo to_message(const CameraIntrinsics& camera) {
  constexpr std::ptrdiff_t kEquidistantTerms = 4;
  ros::CameraInfo message;
  message.width = static_cast<std::uint32_t>(camera.width);
  message.height = static_cast<std::uint32_t>(camera.height);
  const bool equidistant = camera.model == DistortionModel::kEquidistant;
  message.distortion_model = equidistant ? kEquidistant : kPlumbBob;
  message.d.assign(camera.distortion.begin(), equidistant
                                                  ? camera.distortion.begin() + kEquidistantTerms
                                                  : camera.distortion.end());
  message.k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  message.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  message.p = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  return message;
}

Result<SE3> to_se3(const ros::Transform& transform) {
  constexpr double kNormTolerance = 1e-3;
  const Eigen::Quaterniond rotation{transform.rotation.w, transform.rotation.x,
                                    transform.rotation.y, transform.rotation.z};
  const Vector3d translation = to_eigen(transform.translation);
  const bool is_unit = std::abs(rotation.norm() - 1.0) < kNormTolerance;
  if (!is_unit || !translation.allFinite()) {
    return fail(ErrorCode::kInvalidData, "a transform's quaternion has norm {}", rotation.norm());
  }
  return SE3{rotation, translation};
}

ros::Transform to_transform(const SE3& transform) {
  const Eigen::Quaterniond& q = transform.rotation();
  return {.translation = to_ros(transform.translation()),
          .rotation = {.x = q.x(), .y = q.y(), .z = q.z(), .w = q.w()}};
}

}  // namespace geoflow::drivers::bag
