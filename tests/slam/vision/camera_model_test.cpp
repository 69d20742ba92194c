#include "vision/camera_model.hpp"

#include <array>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {
namespace {

CameraIntrinsics with(DistortionModel model,
                      std::array<double, kMaxDistortionCoefficients> distortion) {
  return {.width = 640,
          .height = 480,
          .fx = 517.3,
          .fy = 516.5,
          .cx = 318.6,
          .cy = 255.3,
          .model = model,
          .distortion = distortion};
}

TEST(CameraModel, UndistortInvertsDistort) {
  const std::array cameras = {
      CameraModel{with(DistortionModel::kNone, {})},
      CameraModel{with(DistortionModel::kRadtan,
                       {0.2624, -0.9531, -0.0054, 0.0026, 1.1633})},  // TUM freiburg1
      CameraModel{with(DistortionModel::kEquidistant, {0.01, -0.005, 0.002, -0.001})}};
  for (const CameraModel& camera : cameras) {
    for (double x = 20; x < 640; x += 60) {
      for (double y = 20; y < 480; y += 60) {
        const Vector2d raw{x, y};
        EXPECT_LT((camera.distort(camera.undistort(raw)) - raw).norm(), 1e-3) << raw.transpose();
      }
    }
  }
}

TEST(CameraModel, ProjectionUndoesUnprojectionAndItsJacobianMatchesDifferences) {
  const CameraModel camera{with(DistortionModel::kNone, {})};
  const Vector2d pixel{100.5, 400.25};
  const Vector3d point = camera.unproject(pixel, 2.5);
  EXPECT_LT((camera.project(point) - pixel).norm(), 1e-9);
  constexpr double kStep = 1e-6;
  const Eigen::Matrix<double, 2, 3> J = camera.project_jacobian(point);
  for (int k = 0; k < 3; ++k) {
    const Vector3d step = kStep * Vector3d::Unit(k);
    const Vector2d numeric =
        (camera.project(point + step) - camera.project(point - step)) / (2 * kStep);
    EXPECT_LT((numeric - J.col(k)).norm(), 1e-3);
  }
}

}  // namespace
}  // namespace geoflow::slam
