#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

/// What is known of the sensors' geometry and noise. Kalibr's names and conventions.
namespace geoflow {

enum class DistortionModel : std::uint8_t {
  kNone,
  kRadtan,       ///< k1 k2 p1 p2 (k3): Brown-Conrady as in OpenCV and Kalibr
  kEquidistant,  ///< k1 k2 k3 k4: Kannala-Brandt fisheye
};

/// Coefficients of the longest distortion model.
inline constexpr std::size_t kMaxDistortionCoefficients = 5;

/// A pinhole camera. Pixel centres have integer coordinates, (0, 0) is the centre of the first
/// pixel.
struct CameraIntrinsics {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  double fx = 0;   ///< [px]
  double fy = 0;   ///< [px]
  double cx = 0;   ///< [px]
  double cy = 0;   ///< [px]
  DistortionModel model = DistortionModel::kNone;
  std::array<double, kMaxDistortionCoefficients>
      distortion{};  ///< in the order of `model`; unused ones are 0
};

/// Continuous-time noise, as in Kalibr's imu.yaml. Defaults: the D435i's BMI055 as published for
/// GeoFlow-SLAM's robot.
struct ImuNoise {
  // NOLINTBEGIN(readability-magic-numbers): each default is named, and given its unit, by its
  // member
  double accel_noise_density = 1.176e-2;  ///< [m/s^2/sqrt(Hz)]
  double accel_random_walk = 1e-3;        ///< [m/s^3/sqrt(Hz)]
  double gyro_noise_density = 2.443e-3;   ///< [rad/s/sqrt(Hz)]
  double gyro_random_walk = 1e-4;         ///< [rad/s^2/sqrt(Hz)]
  double rate_hz = 200;
  // NOLINTEND(readability-magic-numbers)
};

/// How depth came to lie on the colour image's pixels.
enum class DepthAlignment : std::uint8_t {
  /// Each pixel has the depth of what it shows.
  kExact,
  /// librealsense's (`align.cpp`; realsense-ros' `aligned_depth_to_color`): each pixel has the
  /// nearest depth of all depth pixels whose outline touches it. That is too near, on a slanted
  /// surface by what depth changes over half a pixel (20 mm on the floor 3 m in front of a camera
  /// 0.3 m high), and by part of the noise.
  kNearestTouching,
};

/// As it stands in files: "exact" or "nearest_touching".
[[nodiscard]] constexpr const char* name_of(DepthAlignment alignment) noexcept {
  return alignment == DepthAlignment::kExact ? "exact" : "nearest_touching";
}
/// The inverse; none of any other name.
[[nodiscard]] constexpr std::optional<DepthAlignment> depth_alignment(
    std::string_view name) noexcept {
  for (const auto alignment : {DepthAlignment::kExact, DepthAlignment::kNearestTouching}) {
    if (name == name_of(alignment)) {
      return alignment;
    }
  }
  return std::nullopt;
}

/// One robot's sensors. Depth is registered to the colour camera and shares its intrinsics.
struct Calibration {
  CameraIntrinsics camera;
  // NOLINTNEXTLINE(readability-magic-numbers): a millimetre
  double depth_unit_m = 1e-3;  ///< metres per count of a kDepth16 pixel
  DepthAlignment depth_alignment = DepthAlignment::kExact;
  std::optional<SE3> T_cam_imu{};
  /// t_imu = t_cam + this (Kalibr's timeshift_cam_imu).
  Duration timeshift_cam_imu{};
  ImuNoise imu_noise{};
  /// Pose of the camera on the robot; none: the base frame is the camera frame.
  std::optional<SE3> T_base_cam{};
  std::string source;  ///< where it was read, for people
  std::string serial;  ///< the camera's serial number; empty where the source does not say
};

}  // namespace geoflow
