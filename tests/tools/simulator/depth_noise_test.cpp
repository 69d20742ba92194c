#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <memory>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "camera_rig.hpp"

// Rendered depth's errors, against the model that src/stereo.hpp states.
namespace geoflow::simulator::tests {
namespace {

constexpr double kFaintSignal = 0.06;
constexpr double kRipple_px = 0.012;
constexpr double kYawRad = 0.2;  // a wall seen askew has all parts of a pixel of disparity

double focal_baseline(const CameraOptions& options) {
  return d435i_ir_intrinsics(options.width, options.height).fx * kD435iBaseline_m;
}

Scene wall_at(float distance_m) {
  Scene scene = daylight_scene();
  add_wall(scene, distance_m, -60, 60, 0.35F);
  return scene;
}

CameraOptions noisy_options() {
  CameraOptions options;
  options.depth_errors = false;
  options.depth_truth = true;
  return options;
}

/// Measured less true disparity; 0 where nothing is measured, between two pixels' rectangles.
double disparity_error_px(const Rendered& rendered, const CameraOptions& options, int x, int y) {
  const int measured_mm = depth_mm(rendered, x, y);
  return measured_mm > 0
             ? focal_baseline(options) * (1e3 / measured_mm - 1 / truth_m(rendered, x, y))
             : 0.0;
}

/// Squared errors of disparity [px^2] of a wall's pixels, and what the model says of each.
struct WallNoise {
  std::vector<double> squared_px2;
  std::vector<double> faintness;  ///< (0.06 / signal)^2
  std::vector<double> rounding_px2;
  double near_correlation = 0;  ///< of pixels one correlation length of the model apart in a row
  double far_correlation = 0;   ///< of pixels three times as far apart
};

/// Of a wall of the model's reference reflectance, without texture: a signal of cosine / z^2.
WallNoise measure_wall(float distance_m, const CameraOptions& options) {
  constexpr int kFrames = 4;
  constexpr int kNear_px = 17;  // 11 px of the infrared camera
  const Scene scene = wall_at(distance_m);
  const auto camera = CameraSimulator::create(scene, options).value();
  const CameraIntrinsics& k = camera->intrinsics();
  WallNoise noise;
  double squares = 0;
  double near = 0;
  double far = 0;
  for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
    const Rendered rendered =
        camera->render(0, frame, [](double) { return looking(0, 0, kYawRad); });
    const auto error_px = [&](int x, int y) { return disparity_error_px(rendered, options, x, y); };
    for (int y = 40; y < 440; y += 2) {
      for (int x = 120; x < 520; x += 2) {
        const double z = truth_m(rendered, x, y);
        const Vector3d direction{(x - k.cx) / k.fx, (y - k.cy) / k.fy, 1};
        const double cosine =
            (std::cos(kYawRad) + std::sin(kYawRad) * direction.x()) / direction.norm();
        const double millimetre_px = 1e-3 * focal_baseline(options) / (z * z);
        noise.squared_px2.push_back(std::pow(error_px(x, y), 2));
        noise.faintness.push_back(std::pow(kFaintSignal * z * z / cosine, 2));
        noise.rounding_px2.push_back((1.0 / 1024 + millimetre_px * millimetre_px) / 12);
        squares += noise.squared_px2.back();
        near += error_px(x, y) * error_px(x + kNear_px, y);
        far += error_px(x, y) * error_px(x + 3 * kNear_px, y);
      }
    }
  }
  noise.near_correlation = near / squares;
  noise.far_correlation = far / squares;
  return noise;
}

TEST(DepthNoise, FollowsTheStereoModel) {
  CameraOptions options = noisy_options();
  options.depth_calibration_px = 0;
  const double best_px2 = std::pow(options.depth_subpixel_px, 2);
  const double ripple_px2 = std::pow(kRipple_px, 2) * 8 / 15;  // the mean square of its parabolas
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (const float distance_m : {0.8F, 1.2F, 1.6F, 2.0F, 3.0F, 4.0F}) {
    const WallNoise noise = measure_wall(distance_m, options);
    double measured_px2 = 0;
    double expected_px2 = 0;
    for (std::size_t i = 0; i < noise.squared_px2.size(); ++i) {
      const double constant_px2 = ripple_px2 + noise.rounding_px2[i];
      const double model_px2 = best_px2 * (1 + noise.faintness[i]) + constant_px2;
      measured_px2 += noise.squared_px2[i];
      expected_px2 += model_px2;
      const Eigen::Vector2d regressors{1 / model_px2, noise.faintness[i] / model_px2};
      normal += regressors * regressors.transpose();
      right += regressors * ((noise.squared_px2[i] - constant_px2) / model_px2);
    }
    const auto count = static_cast<double>(noise.squared_px2.size());
    std::cout << "wall at " << distance_m << " m: deviation " << std::sqrt(measured_px2 / count)
              << " px (model " << std::sqrt(expected_px2 / count) << "), correlation "
              << noise.near_correlation << ", " << noise.far_correlation << "\n";
    EXPECT_NEAR(std::sqrt(measured_px2 / expected_px2), 1.0, 0.1) << distance_m;
    EXPECT_NEAR(noise.near_correlation, 0.48, 0.1) << distance_m;
    EXPECT_NEAR(noise.far_correlation, 0.0, 0.1) << distance_m;
  }
  // The squares of all walls' errors on how faint the pattern is.
  const Eigen::Vector2d found = normal.ldlt().solve(right);
  const double subpixel_px = std::sqrt(found[0]);
  const double faint = kFaintSignal * std::sqrt(found[1] / found[0]);
  std::cout << "regressed: " << subpixel_px << " px, doubled in square at a signal of " << faint
            << "\n";
  EXPECT_NEAR(subpixel_px, options.depth_subpixel_px, 0.1 * options.depth_subpixel_px);
  EXPECT_NEAR(faint, kFaintSignal, 0.1 * kFaintSignal);
}

TEST(DepthNoise, BetweenWholePixelsDisparityErrsAsARipple) {
  CameraOptions options = noisy_options();
  options.depth_subpixel_px = 0;
  options.depth_calibration_px = 0;
  const Scene scene = wall_at(1.0F);
  const auto camera = CameraSimulator::create(scene, options).value();
  const Rendered rendered = camera->render(0, 0, [](double) { return looking(0, 0, kYawRad); });
  double along_sine = 0;
  double along_cosine = 0;
  int count = 0;
  for (int y = 40; y < 440; y += 2) {
    for (int x = 120; x < 520; ++x, ++count) {
      const double disparity_px = focal_baseline(options) / truth_m(rendered, x, y);
      const double error_px = disparity_error_px(rendered, options, x, y);
      along_sine += 2 * error_px * std::sin(2 * std::numbers::pi * disparity_px);
      along_cosine += 2 * error_px * std::cos(2 * std::numbers::pi * disparity_px);
    }
  }
  std::cout << "ripple " << along_sine / count << " px along sine, " << along_cosine / count
            << " along cosine\n";
  EXPECT_NEAR(along_sine / count, kRipple_px, 0.2 * kRipple_px);
  EXPECT_NEAR(along_cosine / count, 0, 0.2 * kRipple_px);
}

TEST(DepthNoise, WhatCalibrationLeavesIsTheSameInAllFramesOfADevice) {
  constexpr float kDistance_m = 2.0F;
  constexpr std::uint64_t kDevices = 6;
  CameraOptions options = noisy_options();
  const Scene scene = wall_at(kDistance_m);
  double common = 0;
  double other = 0;
  int count = 0;
  Rendered of_another;
  for (options.seed = 1; options.seed <= kDevices; ++options.seed) {
    const auto camera = CameraSimulator::create(scene, options).value();
    const auto render = [&](std::uint64_t frame) {
      return camera->render(0, frame, [](double) { return looking(0, 0, kYawRad); });
    };
    const Rendered first = render(1);
    const Rendered second = render(2);
    for (int y = 40; y < 440; y += 4) {
      for (int x = 80; x < 560; x += 4, ++count) {
        const auto error_px = [&](const Rendered& rendered) {
          return disparity_error_px(rendered, options, x, y);
        };
        common += error_px(first) * error_px(second);
        other += options.seed > 1 ? error_px(first) * error_px(of_another) : 0.0;
      }
    }
    of_another = first;
  }
  const double common_px = std::sqrt(common / count);
  const double of_all_px = std::sqrt(std::abs(other) / count);
  std::cout << "in common between frames " << common_px << " px, between devices " << of_all_px
            << "\n";
  // Of so smooth a field an image holds some 12 independent values, of six 72; and the ripple is
  // common to all.
  const double expected_px =
      std::hypot(options.depth_calibration_px, kRipple_px * std::sqrt(8.0 / 15));
  EXPECT_NEAR(common_px / expected_px, 1.0, 3.0 / std::sqrt(2.0 * 72));
  EXPECT_LT(of_all_px, 0.7 * common_px);
}

}  // namespace
}  // namespace geoflow::simulator::tests
