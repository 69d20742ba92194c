#pragma once

#include <cstdint>
#include <string>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

/// Between ROS messages and this project's samples, both ways. Pure, thread-safe.
namespace geoflow::drivers::bag {

/// Nanoseconds of a message's stamp; kInvalidData where nanosec is not below 10^9.
[[nodiscard]] Result<Duration> to_duration(const ros::Time& stamp);
/// The stamp; kInvalidArgument beyond the range of its 32-bit seconds.
[[nodiscard]] Result<ros::Time> to_stamp(Duration since_epoch);

[[nodiscard]] ImuSample to_sample(const ros::Imu& message);
/// Fills in what an ImuSample has; orientation is marked as not given.
[[nodiscard]] ros::Imu to_message(const ImuSample& sample);

/// Joints by name, in any order: leg FR, FL, RR, RL and then hip, thigh, calf or 0, 1, 2
/// (`FR_thigh_joint`, `FR1`), foot force by name in `effort` (`FR_foot`); legs whose joints are not
/// all there are marked invalid. Names that are missing or tell no leg: 12 joints, then 0 or 4
/// feet, in Unitree's SDK order. kInvalidData where names are mixed or double, or counts do not
/// fit.
[[nodiscard]] Result<LegSample> to_sample(const ros::JointState& message);
/// By URDF joint names; the joints of invalid legs are left out.
[[nodiscard]] ros::JointState to_message(const LegSample& sample);

[[nodiscard]] BodyVelocitySample to_sample(const ros::Odometry& message);
[[nodiscard]] ros::Odometry to_message(const BodyVelocitySample& sample);

/// The image with a copy of its bytes. Colour: rgb8, bgr8, mono8, yuv422_yuy2 and their OpenCV
/// names; depth: 16UC1, mono16 and 32FC1 (metres). Errors say which encoding, or how many bytes are
/// missing.
[[nodiscard]] Result<EncodedImage> to_image(const ros::Image& message, ImageStream stream);
/// JPEG or PNG; depth as image_transport's compressedDepth (16UC1 as PNG behind 12 bytes of
/// parameters) or as a plain PNG.
[[nodiscard]] Result<EncodedImage> to_image(const ros::CompressedImage& message,
                                            ImageStream stream);
/// A view of the frame's pixels.
[[nodiscard]] ros::Image to_message(const FrameRef& frame);

/// K and D of a raw image; kUnsupported for distortion models other than plumb_bob,
/// rational_polynomial without its further terms, and equidistant; kInvalidData without a focal
/// length.
[[nodiscard]] Result<CameraIntrinsics> to_intrinsics(const ros::CameraInfo& message);
[[nodiscard]] ros::CameraInfo to_message(const CameraIntrinsics& camera);

/// kInvalidData where it is not a rigid transform.
[[nodiscard]] Result<SE3> to_se3(const ros::Transform& transform);
[[nodiscard]] ros::Transform to_transform(const SE3& transform);

}  // namespace geoflow::drivers::bag
