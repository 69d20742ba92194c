#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "camera_rig.hpp"

// What the simulated camera says, against the geometry that it says it of.
namespace geoflow::simulator::tests {
namespace {

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Bilinear in inverse depth, which is linear over a plane's image; 0 beside steps and at the
/// border.
double inverse_depth_at(const Rendered& rendered, double x, double y) {
  constexpr double kStep = 0.05;
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const ImageShape& shape = rendered.color.shape();
  if (x0 < 0 || y0 < 0 || x0 + 1 >= shape.width || y0 + 1 >= shape.height) {
    return 0;
  }
  std::array<double, 4> near{};
  for (int i = 0; i < 4; ++i) {
    const double depth = truth_m(rendered, x0 + i % 2, y0 + i / 2);
    near.at(static_cast<std::size_t>(i)) = depth > 0 ? 1.0 / depth : 0.0;
  }
  const auto [low, high] = std::ranges::minmax(near);
  if (low <= 0 || high - low > kStep * high) {
    return 0;
  }
  const double fx = x - x0;
  const double fy = y - y0;
  return (near[0] * (1 - fx) + near[1] * fx) * (1 - fy) + (near[2] * (1 - fx) + near[3] * fx) * fy;
}

double blue_at(const Rendered& rendered, double x, double y) {
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const double fx = x - x0;
  const double fy = y - y0;
  return (blue(rendered, x0, y0) * (1 - fx) + blue(rendered, x0 + 1, y0) * fx) * (1 - fy) +
         (blue(rendered, x0, y0 + 1) * (1 - fx) + blue(rendered, x0 + 1, y0 + 1) * fx) * fy;
}

/// How much true depth changes over an infrared pixel, which is 1.6 of colour: registered depth is
/// that of a rectangle.
double slope_m(const Rendered& rendered, int x, int y) {
  constexpr double kColorPixels = 608.8 / 383.5;
  const ImageShape& shape = rendered.color.shape();
  const int x1 = std::min(x + 1, shape.width - 1);
  const int y1 = std::min(y + 1, shape.height - 1);
  return kColorPixels * (std::abs(truth_m(rendered, x1, y) - truth_m(rendered, x1 - 1, y)) +
                         std::abs(truth_m(rendered, x, y1) - truth_m(rendered, x, y1 - 1)));
}

/// Differences after every pixel of one frame is moved to another by the true poses.
struct WarpErrors {
  std::vector<double> truth_m;
  std::vector<double> measured_m;
  std::vector<double>
      beyond_pixel_m;  ///< of measured, less what depth changes over one infrared pixel
  std::vector<double> brightness_ratio;
};

WarpErrors warp(const Rendered& first, const Rendered& second, const SE3& T_second_first,
                const CameraIntrinsics& k) {
  constexpr double kFar_m = 4.0;
  WarpErrors errors;
  for (int y = 0; y < k.height; y += 3) {
    for (int x = 0; x < k.width; x += 3) {
      const Vector3d direction{(x - k.cx) / k.fx, (y - k.cy) / k.fy, 1.0};
      const auto moved = [&](double depth) {
        return Vector3d{T_second_first * Vector3d{depth * direction}};
      };
      const double true_depth = truth_m(first, x, y);
      const Vector3d p = moved(true_depth);
      if (true_depth <= 0 || true_depth > kFar_m || p.z() <= 0) {
        continue;
      }
      const Vector2d pixel{k.fx * p.x() / p.z() + k.cx, k.fy * p.y() / p.z() + k.cy};
      const double inverse = inverse_depth_at(second, pixel.x(), pixel.y());
      // A surface that the second view does not see is no disagreement.
      if (inverse <= 0 || std::abs(1.0 / inverse - p.z()) > 0.1) {
        continue;
      }
      errors.truth_m.push_back(std::abs(1.0 / inverse - p.z()));
      errors.brightness_ratio.push_back(blue_at(second, pixel.x(), pixel.y()) /
                                        std::max(1.0, blue(first, x, y)));
      const double measured = 1e-3 * depth_mm(first, x, y);
      if (measured > 0) {
        const Vector3d q = moved(measured);
        const double there =
            inverse_depth_at(second, k.fx * q.x() / q.z() + k.cx, k.fy * q.y() / q.z() + k.cy);
        if (there > 0) {
          const double error_m = std::abs(1.0 / there - q.z());
          errors.measured_m.push_back(error_m);
          errors.beyond_pixel_m.push_back(std::max(0.0, error_m - slope_m(first, x, y)));
        }
      }
    }
  }
  return errors;
}

TEST(CameraTruth, AFrameWarpedByTheTruePosesIsTheTenthAfterIt) {
  const Scene scene = make_scene("office", 2, {}).value();
  CameraOptions options = exact_options();
  options.readout_s = 0;
  options.exposure_min_s = options.exposure_max_s = 1e-4;
  options.gain_max = 256;
  options.subexposures = 16;
  const auto camera = CameraSimulator::create(scene, options).value();
  const Vector2d start = scene.path()[0];
  const Vector2d heading = (scene.path()[1] - start).normalized();
  const double yaw_rad = std::atan2(heading.y(), heading.x());
  const auto pose = [&](double t_s) {
    const Vector2d at = start + 0.8 * t_s * heading;
    return looking(at.x(), at.y(), yaw_rad + 0.1 * std::sin(3.0 * t_s),
                   0.1 + 0.03 * std::sin(17.0 * t_s));
  };
  constexpr double kLater_s = 10.0 / 30.0;
  const Rendered first = camera->render(1.0, 30, pose);
  const Rendered second = camera->render(1.0 + kLater_s, 40, pose);
  const SE3 T_second_first =
      pose(1.0 + kLater_s).inverse() * pose(1.0);  // frames: two moments of one camera
  WarpErrors errors = warp(first, second, T_second_first, camera->intrinsics());
  ASSERT_GT(errors.truth_m.size(), 8000U);
  const double truth_mm = 1e3 * median(errors.truth_m);
  const double measured_mm = 1e3 * median(errors.measured_m);
  const double exposure = median(errors.brightness_ratio);
  std::vector<double> brightness;
  brightness.reserve(errors.brightness_ratio.size());
  for (const double ratio : errors.brightness_ratio) {
    brightness.push_back(std::abs(ratio / exposure - 1.0));
  }
  std::cout << "warped over 10 frames: true depth " << truth_mm << " mm, registered depth "
            << measured_mm << " mm, brightness " << 100 * median(brightness) << " %\n";
  EXPECT_LT(truth_mm, 0.5);
  std::ranges::sort(errors.beyond_pixel_m);
  const double beyond_mm = 1e3 * errors.beyond_pixel_m[errors.beyond_pixel_m.size() * 3 / 4];
  std::cout << "registered depth beyond what one infrared pixel spans, upper quartile: "
            << beyond_mm << " mm\n";
  EXPECT_LT(beyond_mm, 2.0);
  EXPECT_LT(median(brightness), 0.04);
}

TEST(CameraTruth, NoRaySlipsThroughAWall) {
  Scene scene = daylight_scene();
  add_wall(scene, 3.0F, -60, 60, 0.35F);
  const auto camera = CameraSimulator::create(scene, exact_options()).value();
  const Rendered rendered = camera->render(0, 0, [](double) { return looking(0, 0, 0.2); });
  const auto beyond = [](float depth_m) { return depth_m == 0; };
  EXPECT_EQ(std::ranges::count_if(rendered.depth_truth, beyond), 0);
}

}  // namespace
}  // namespace geoflow::simulator::tests
