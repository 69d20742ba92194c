#pragma once

#include "geoflow/hal/geometry.hpp"

/// Where the camera sits on the simulated robot, and its IMU in it. The D435i has no standard mount
/// on a Go2; recordings of the simulator carry these as their calibration.
namespace geoflow::simulator {

// NOLINTBEGIN(readability-identifier-naming): transforms keep their frames' names

/// A D435i on a bracket over the Go2's own front camera (0.327, 0, 0.043 in base, by its URDF):
/// colour camera at (0.33, 0.0325, 0.06) and looking 5 degrees downwards. The colour lens
/// stands 32.5 mm to the left of the housing's middle, which is on the robot's middle line.
[[nodiscard]] SE3 go2_T_base_cam();

/// Colour camera in the depth (left infrared) camera. Source: rs-enumerate-devices of a D435i
/// (realsense-ros issue 2788): 15 mm to the left, turned by half a degree.
[[nodiscard]] SE3 d435i_T_depth_cam();

/// The IMU in the colour camera: the same colour extrinsics, and the depth to IMU transform that
/// librealsense uses for every D435i without an own calibration, (-5.52, 5.1, 11.74) mm without
/// rotation.
[[nodiscard]] SE3 d435i_T_cam_imu();

// NOLINTEND(readability-identifier-naming)

}  // namespace geoflow::simulator
