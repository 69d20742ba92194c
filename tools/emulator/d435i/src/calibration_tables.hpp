#pragma once

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

/// The calibration that a D435i carries, made for another camera: one whose depth lies on its
/// colour image and which has no distortion. Layouts: librealsense's structures, numbers little
/// endian, matrices column by column.
namespace geoflow::emulator {

/// Table 25 (512 bytes): stereo geometry, and focal lengths and centres of the rectified left image
/// for each size.
[[nodiscard]] Bytes depth_table(const CameraIntrinsics& source);

/// Table 32 (256 bytes): the colour camera; it stands where the left imager does.
[[nodiscard]] Bytes color_table(const CameraIntrinsics& source);

/// The motion module's table (520 bytes): where the IMU is; its own calibration is not said.
/// `T_imu_cam` as in Calibration.
[[nodiscard]] Bytes motion_table(const SE3& T_imu_cam);

/// The answer to RECPARAMSGET: size, focal lengths and centre of each depth size, 20 bytes each.
[[nodiscard]] Bytes rectified_sizes(const CameraIntrinsics& source);

}  // namespace geoflow::emulator
