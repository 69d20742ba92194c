#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

/// The camera's calibration, as its firmware stores it.
///
/// Each table begins with a header of 16 bytes: version (big-endian), type, payload size,
/// parameter, CRC-32 (that of zlib) of everything behind the header. Matrices are stored column by
/// column. Source: librealsense, src/ds/d400/d400-private.h and ds-calib-parsers.cpp.
namespace geoflow::drivers::d435i {

/// Depth (left imager, rectified) in pixels at the resolutions that the table has.
struct DepthTable {
  double baseline_m = 0;  ///< distance of the two imagers, positive
  /// fx, fy, cx, cy of each listed resolution.
  std::vector<CameraIntrinsics> intrinsics{};
};

/// The colour camera.
struct ColorTable {
  Matrix3d K_normalised = Matrix3d::Zero();  ///< on [-1, 1], at the calibrated aspect ratio
  int width = 0;                             ///< at which it was calibrated [px]
  int height = 0;                            ///< [px]
  std::array<double, kMaxDistortionCoefficients> distortion{};  ///< Brown-Conrady
  SE3 T_depth_cam;  ///< colour camera in the depth camera's frame [m]
};

/// The IMU.
struct ImuTable {
  std::optional<SE3> T_imu_depth{};  ///< depth camera in the IMU's frame; none: not in the table
  /// Corrected = scale * raw - bias, in the depth camera's axes [m/s^2], [rad/s].
  Matrix3d accel_scale = Matrix3d::Identity();
  Vector3d accel_bias_mps2 = Vector3d::Zero();
  Matrix3d gyro_scale = Matrix3d::Identity();
  Vector3d gyro_bias_radps = Vector3d::Zero();
};

/// Table 25. kInvalidData where it is short, of another type, its CRC is wrong, or its numbers are
/// not a camera's. Pure, as all of these.
[[nodiscard]] Result<DepthTable> parse_depth_table(std::span<const std::byte> table);
/// Table 32; likewise.
[[nodiscard]] Result<ColorTable> parse_color_table(std::span<const std::byte> table);
/// The answer to Opcode::kImuCalibration; likewise.
[[nodiscard]] Result<ImuTable> parse_imu_table(std::span<const std::byte> table);
/// The answer to Opcode::kResolutionIntrinsics: depth intrinsics by resolution. Entries of size 0
/// are left out.
[[nodiscard]] Result<std::vector<CameraIntrinsics>> parse_resolution_intrinsics(
    std::span<const std::byte> data);
/// Metres a count of depth, from the answer to Opcode::kAdvancedParameters, group 9.
[[nodiscard]] Result<double> parse_depth_unit_m(std::span<const std::byte> data);

/// The group of Opcode::kAdvancedParameters that has the depth unit.
inline constexpr std::uint32_t kDepthUnitGroup = 9;
/// The depth unit where advanced mode is off.
inline constexpr double kDefaultDepthUnit_m = 1e-3;

/// Depth intrinsics at a size, by the table alone: the listed ones, or a known crop (848x100,
/// 256x144), or the first entry scaled. kNotFound where the table has nothing to go by.
[[nodiscard]] Result<CameraIntrinsics> depth_intrinsics(const DepthTable& table, int width,
                                                        int height);
/// Colour intrinsics at a size.
[[nodiscard]] CameraIntrinsics color_intrinsics(const ColorTable& table, int width, int height);

/// Where the IMU sits when no table says: T_imu_depth of the D435i's drawings.
[[nodiscard]] SE3 default_imu_pose();

}  // namespace geoflow::drivers::d435i
