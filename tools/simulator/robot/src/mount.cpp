#include "geoflow/tools/simulator/mount.hpp"

#include <numbers>

#include "geoflow/hal/geometry.hpp"

namespace geoflow::simulator {

// NOLINTBEGIN(readability-magic-numbers,readability-identifier-naming): as the header says

SE3 go2_T_base_cam() {
  constexpr double kPitchDown = 5 * std::numbers::pi / 180;
  Matrix3d level;    // columns: the camera's right, down and forward in base
  level << 0, 0, 1,  //
      -1, 0, 0,      //
      0, -1, 0;
  const Matrix3d pitched = Eigen::AngleAxisd{kPitchDown, Vector3d::UnitY()} * level;
  return SE3{pitched, Vector3d{0.33, 0.0325, 0.06}};
}

SE3 d435i_T_depth_cam() {
  Matrix3d R;
  R << 0.999956, -0.009402, -0.000683,  //
      0.009402, 0.999955, -0.000868,    //
      0.000691, 0.000861, 0.999999;
  return SE3{R, Vector3d{-0.01501, 0.00136, -0.00025}};
}

SE3 d435i_T_cam_imu() {
  const SE3 T_imu_depth{Eigen::Quaterniond::Identity(), Vector3d{-0.00552, 0.0051, 0.01174}};
  return (T_imu_depth * d435i_T_depth_cam()).inverse();
}

// NOLINTEND(readability-magic-numbers,readability-identifier-naming)

}  // namespace geoflow::simulator
