#include "vision/row_time.hpp"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

#include "vision/camera_model.hpp"

namespace geoflow::slam {
namespace {

constexpr int kRows = 480;

CameraModel camera() {
  return CameraModel{
      CameraIntrinsics{.width = 640, .height = kRows, .fx = 600, .fy = 600, .cx = 320, .cy = 240}};
}

/// Where a point is seen by a camera that moves while it reads its rows out.
Vector2d seen(const CameraModel& model, const Vector3d& p_cam, const Vector6d& twist,
              double readout_s) {
  Vector2d pixel = model.project(p_cam);
  for (int i = 0; i < 10; ++i) {
    const double later_s = readout_s * ((pixel.y() + 0.5) / kRows - 0.5);
    pixel = model.project(SE3::exp(twist * later_s).inverse() * p_cam);
  }
  return pixel;
}

std::vector<Vector3d> points(std::mt19937& random) {
  std::uniform_real_distribution<double> share{-1, 1};
  std::vector<Vector3d> made;
  for (int i = 0; i < 120; ++i) {
    const double z = 2.5 + share(random);
    made.emplace_back(0.5 * z * share(random), 0.38 * z * share(random), z);
  }
  return made;
}

Vector6d trot(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Vector6d twist;
  for (int i = 0; i < 3; ++i) {
    twist[i] = 0.2 * normal(random);
    twist[i + 3] = 0.3 * normal(random);
  }
  return twist;
}

TEST(RowShift, PutsAFeatureWhereTheMiddleOfTheImageWouldHaveShownIt) {
  const CameraModel model = camera();
  std::mt19937 random{1};  // NOLINT(cert-msc51-cpp): the same every time
  constexpr double kReadout_s = 0.02;
  for (int image = 0; image < 10; ++image) {
    const Vector6d twist = trot(random);
    for (const Vector3d& p_cam : points(random)) {
      const Vector2d pixel = seen(model, p_cam, twist, kReadout_s);
      const Vector2d shift = row_shift(model, twist, pixel, pixel.y(), p_cam.z());
      // What constant image velocity leaves: of second order.
      EXPECT_LT((pixel + kReadout_s * shift - model.project(p_cam)).norm(), 0.05);
    }
  }
}

TEST(RowShift, WithoutDepthTakesTheTurn) {
  const CameraModel model = camera();
  const Vector6d turn = (Vector6d{} << 0.1, -0.3, 0.05, 0, 0, 0).finished();
  const Vector6d both = (Vector6d{} << 0.1, -0.3, 0.05, 1, 0, 0).finished();
  const Vector2d pixel{100, 400};
  EXPECT_EQ(row_shift(model, both, pixel, 400, 0), row_shift(model, turn, pixel, 400, 3));
}

class ReadoutEstimateTest : public testing::Test {
 protected:
  /// Images of a camera that moves as `motion` says, at poses that are off by what a frame's are.
  template <typename Motion>
  void see(double readout_s, int images, const Motion& motion) {
    const CameraModel model = camera();
    std::mt19937 random{7};  // NOLINT(cert-msc51-cpp): the same every time
    std::normal_distribution<double> normal;
    for (int image = 0; image < images; ++image) {
      const Vector6d twist = motion(random);
      Vector6d off;
      for (double& value : off) {
        value = 2e-3 * normal(random);
      }
      std::vector<ReadoutEstimate::Feature> features;
      for (const Vector3d& p_true : points(random)) {
        const Vector3d p_cam = SE3::exp(off) * p_true;
        const Vector2d pixel = seen(model, p_true, twist, readout_s) +
                               Vector2d{0.5 * normal(random), 0.5 * normal(random)};
        const Vector2d shift = row_shift(model, twist, pixel, pixel.y(), p_true.z());
        Eigen::Matrix<double, 3, 6> point_by_pose;
        point_by_pose << skew(p_cam), -Matrix3d::Identity();
        features.push_back(
            {.shift = shift,
             .residual = model.project(p_cam) - (pixel + estimate_.seconds() * shift),
             .by_pose = model.project_jacobian(p_cam) * point_by_pose});
      }
      estimate_.add(features, 0.5);
    }
  }

  ReadoutEstimate estimate_;
};

TEST_F(ReadoutEstimateTest, FindsHowLongTheRowsTakeAndSaysHowWell) {
  see(0.02, 60, trot);
  EXPECT_NEAR(estimate_.seconds(), 0.02, 3 * estimate_.sigma());
  EXPECT_LT(estimate_.sigma(), 0.0005);
}

TEST_F(ReadoutEstimateTest, AnUpsideDownCamerasRowsGoUpwards) {
  see(-0.015, 60, trot);
  EXPECT_NEAR(estimate_.seconds(), -0.015, 3 * estimate_.sigma());
}

TEST_F(ReadoutEstimateTest, AGlobalShutterHasNone) {
  see(0, 60, trot);
  EXPECT_NEAR(estimate_.seconds(), 0, 3 * estimate_.sigma());
  EXPECT_LT(estimate_.sigma(), 0.0005);
}

TEST_F(ReadoutEstimateTest, StandingTeachesNothing) {
  see(0.02, 60, [](std::mt19937&) -> Vector6d { return Vector6d::Zero(); });
  EXPECT_EQ(estimate_.seconds(), 0);
  EXPECT_EQ(estimate_.sigma(), 0.01);
}

TEST_F(ReadoutEstimateTest, AFewFeaturesOrBrokenOnesTeachNothing) {
  estimate_.add(std::vector<ReadoutEstimate::Feature>(5, {.shift = {9, 9}, .residual = {1, 1}}), 1);
  const ReadoutEstimate::Feature broken{.shift = {9, 9}, .residual = {1, std::nan("")}};
  estimate_.add(std::vector<ReadoutEstimate::Feature>(50, broken), 1);
  EXPECT_EQ(estimate_.seconds(), 0);
}

}  // namespace
}  // namespace geoflow::slam
