#include "geoflow/tools/simulator/camera.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "camera_rig.hpp"
#include "src/ray_scene.hpp"
#include "src/view.hpp"

namespace geoflow::simulator::tests {
namespace {

std::unique_ptr<CameraSimulator> make(const Scene& scene, const CameraOptions& options) {
  return CameraSimulator::create(scene, options).value();
}

TEST(CameraOptions, OutOfRangeAreRefusedByName) {
  const Scene scene = daylight_scene();
  CameraOptions options;
  options.subexposures = 0;
  const auto created = CameraSimulator::create(scene, options);
  ASSERT_FALSE(created);
  EXPECT_NE(created.error().message.find("camera.subexposures"), std::string::npos);
}

TEST(Camera, SeesTheTrueDepthOfAWall) {
  Scene scene = daylight_scene();
  add_wall(scene, 3.0F, -40, 40, 0.5F);
  const auto camera = make(scene, exact_options());
  const Rendered rendered = camera->render(0, 0, [](double) { return looking(0.5, 0, 0); });
  for (const int x : {10, 320, 630}) {
    for (const int y : {10, 240, 470}) {
      EXPECT_NEAR(truth_m(rendered, x, y), 2.5, 1e-4);
      // The infrared camera is turned against colour by half a degree, so a registered pixel may be
      // a neighbour's.
      EXPECT_NEAR(depth_mm(rendered, x, y), 2500, 4) << x << " " << y;
    }
  }
}

TEST(Camera, ARenderedFrameIsTheSameWithAnyNumberOfThreads) {
  const Scene scene = make_scene("corridor", 2, {}).value();
  CameraOptions options;
  options.width = 320;
  options.height = 240;
  options.depth_truth = true;
  const auto camera = make(scene, options);
  const Vector2d start = scene.path().front();
  const auto pose = [&](double t_s) { return looking(start.x() + t_s, start.y(), 0.1 * t_s); };
  const auto render = [&](int threads) {
    Rendered rendered;
    tbb::task_arena arena{threads};
    arena.execute([&] { rendered = camera->render(1.5, 45, pose); });
    return rendered;
  };
  const Rendered one = render(1);
  static_cast<void>(camera->render(7.0, 3, pose));
  const Rendered two = render(2);
  EXPECT_TRUE(std::ranges::equal(one.color.bytes(), two.color.bytes()));
  EXPECT_TRUE(std::ranges::equal(one.depth.bytes(), two.depth.bytes()));
  EXPECT_EQ(one.depth_truth, two.depth_truth);
}

TEST(Camera, NoiseDiffersBetweenFramesAndSeeds) {
  Scene scene = daylight_scene();
  add_wall(scene, 2.0F, -40, 40, 0.5F);
  CameraOptions options;
  options.width = 160;
  options.height = 120;
  const auto pose = [](double) { return looking(0, 0, 0); };
  const auto camera = make(scene, options);
  options.seed = 2;
  const auto other = make(scene, options);
  const Rendered first = camera->render(0, 0, pose);
  const Rendered second = camera->render(0, 1, pose);
  const Rendered seeded = other->render(0, 0, pose);
  EXPECT_FALSE(std::ranges::equal(first.color.bytes(), second.color.bytes()));
  EXPECT_FALSE(std::ranges::equal(first.depth.bytes(), second.depth.bytes()));
  EXPECT_FALSE(std::ranges::equal(first.color.bytes(), seeded.color.bytes()));
}

TEST(Camera, ExposesLongerAndThenAmplifiesInTheDark) {
  const auto seen = [](float sky_nit) {
    Scene scene = daylight_scene();
    scene.daylight->sky_nit = sky_nit;
    add_wall(scene, 2.0F, -40, 40, 0.4F);
    return make(scene, exact_options())->render(0, 0, [](double) { return looking(0, 0, 0); });
  };
  const Rendered bright = seen(3000);
  const Rendered dim = seen(300);
  const Rendered dark = seen(10);
  EXPECT_NEAR(dim.exposure_s / bright.exposure_s, 10.0, 0.1);
  EXPECT_EQ(bright.gain, 1.0);
  EXPECT_EQ(dark.exposure_s, 0.033);
  EXPECT_GT(dark.gain, 1.5);
  EXPECT_NEAR(blue(bright, 320, 240), blue(dim, 320, 240), 2.0);
  EXPECT_NEAR(blue(bright, 320, 240), blue(dark, 320, 240), 2.0);
}

TEST(Camera, SensorNoiseIsThatOfPhotonsAndGrowsWithGain) {
  const auto deviation = [](float sky_nit) {
    Scene scene = daylight_scene();
    scene.daylight->sky_nit = sky_nit;
    add_wall(scene, 2.0F, -40, 40, 0.4F);
    const CameraOptions options;
    const Rendered rendered =
        make(scene, options)->render(0, 0, [](double) { return looking(0, 0, 0); });
    double sum = 0;
    double squares = 0;
    int count = 0;
    for (int y = 200; y < 280; ++y) {
      for (int x = 280; x < 360; ++x, ++count) {
        sum += blue(rendered, x, y);
        squares += blue(rendered, x, y) * blue(rendered, x, y);
      }
    }
    return std::pair{rendered, std::sqrt(squares / count - (sum / count) * (sum / count))};
  };
  const auto [bright, bright_deviation] = deviation(3000);
  const auto [dark, dark_deviation] = deviation(4);
  // At middle grey 3200 electrons at gain 1: a relative deviation of 1/sqrt(3200), times the slope
  // of sRGB's curve, about 0.42 in relative terms; about a code of rounding besides.
  const double expected = blue(bright, 320, 240) * 0.44 / std::sqrt(3200.0);
  EXPECT_NEAR(bright_deviation, std::hypot(expected, 0.29), 0.3);
  EXPECT_NEAR(dark_deviation / bright_deviation, std::sqrt(dark.gain), 0.25 * std::sqrt(dark.gain));
}

/// The column where brightness along a row passes the middle between its ends.
double edge_column(const Rendered& rendered, int y) {
  const int width = rendered.color.shape().width;
  const double middle = 0.5 * (blue(rendered, 5, y) + blue(rendered, width - 5, y));
  for (int x = 5; x + 6 < width; ++x) {
    const double here = blue(rendered, x, y);
    const double next = blue(rendered, x + 1, y);
    if ((here - middle) * (next - middle) <= 0 && here != next) {
      return x + (middle - here) / (next - here);
    }
  }
  return -1;
}

/// The same over rows around y, so that rays' random places within pixels average out.
double mean_edge_column(const Rendered& rendered, int y) {
  constexpr int kRows = 15;
  double sum = 0;
  for (int row = y - kRows; row <= y + kRows; ++row) {
    sum += edge_column(rendered, row);
  }
  return sum / (2 * kRows + 1);
}

TEST(Camera, TheRollingShutterSlantsAnUprightEdgeOfATurningView) {
  Scene scene = daylight_scene();
  add_wall(scene, 4.0F, -40, 0, 0.1F);
  add_wall(scene, 4.0F, 0, 40, 0.8F);
  constexpr double kRate_radps = 0.8;
  CameraOptions options = exact_options();
  options.subexposures = 16;
  options.readout_s = 0.02;
  const auto camera = make(scene, options);
  const Rendered rendered =
      camera->render(10, 0, [](double t_s) { return looking(0, 0, kRate_radps * (t_s - 10)); });
  const double slant_px = mean_edge_column(rendered, 440) - mean_edge_column(rendered, 40);
  const double expected_px = kRate_radps * 0.02 * 400.0 / 480.0 * camera->intrinsics().fx;
  EXPECT_NEAR(slant_px, expected_px, 0.4);

  options.readout_s = 0;
  const Rendered global = make(scene, options)->render(10, 0, [](double t_s) {
    return looking(0, 0, kRate_radps * (t_s - 10));
  });
  EXPECT_NEAR(mean_edge_column(global, 440) - mean_edge_column(global, 40), 0.0, 0.3);
}

TEST(Camera, MotionBlurIsAsWideAsTheTurnDuringTheExposure) {
  Scene scene = daylight_scene();
  scene.daylight->sky_nit = 30;
  add_wall(scene, 4.0F, -40, 0, 0.1F);
  add_wall(scene, 4.0F, 0, 40, 0.8F);
  CameraOptions options = exact_options();
  options.readout_s = 0;
  options.subexposures = 64;
  const auto camera = make(scene, options);
  const auto width_px = [&](double rate_radps) {
    const Rendered rendered =
        camera->render(10, 0, [=](double t_s) { return looking(0, 0, rate_radps * (t_s - 10)); });
    const double low = blue(rendered, 620, 240);
    const double high = blue(rendered, 20, 240);
    int between = 0;
    for (int x = 5; x < 635; ++x) {
      const double share = (blue(rendered, x, 240) - low) / (high - low);
      between += share > 0.02 && share < 0.98 ? 1 : 0;
    }
    return std::pair{between, rendered.exposure_s};
  };
  const auto [still, ignored] = width_px(0.0);
  const auto [turning, exposure_s] = width_px(1.0);
  EXPECT_LE(still, 3);
  EXPECT_NEAR(turning, exposure_s * camera->intrinsics().fx, 4.0);
}

TEST(Camera, TheDepthOffsetShowsAnotherMoment) {
  Scene scene = daylight_scene();
  add_wall(scene, 3.0F, -40, 40, 0.5F);
  CameraOptions options = exact_options();
  options.depth_offset_s = 0.02;
  const auto camera = make(scene, options);
  const Rendered rendered =
      camera->render(0, 0, [](double t_s) { return looking(5.0 * t_s, 0, 0); });
  EXPECT_NEAR(truth_m(rendered, 320, 240), 3.0, 1e-4);
  EXPECT_NEAR(depth_mm(rendered, 320, 240), 2900, 4);
}

TEST(Camera, PedestriansAreSeenWhereTheyWalk) {
  Scene scene = daylight_scene();
  add_wall(scene, 8.0F, -40, 40, 0.7F);
  scene.materials.push_back({.albedo = Rgb{0.1F, 0.1F, 0.1F, 0}});
  const int dark = static_cast<int>(scene.materials.size()) - 1;
  scene.pedestrians.emplace_back(Pedestrian::Walk{
      .waypoints = {{3, -5}, {3, 5}}, .speed_mps = 1.0F, .materials = {dark, dark, dark, dark}});
  const auto camera = make(scene, exact_options());
  const auto pose = [](double) { return looking(0, 0, 0); };
  const Rendered before = camera->render(1.0, 0, pose);
  const Rendered passing = camera->render(5.0, 1, pose);
  EXPECT_NEAR(truth_m(before, 316, 150), 8.0, 1e-3);
  EXPECT_NEAR(truth_m(passing, 316, 100), 3.0, 0.4);
  EXPECT_LT(blue(passing, 316, 100), 0.6 * blue(before, 316, 100));
}

TEST(RayScene, LimbsKeepTheirThicknessWhileTheyMove) {
  constexpr float kBeside_m = 2.0F;
  constexpr double kInterval_s = 0.05;
  Scene scene = daylight_scene();
  scene.materials.push_back({});
  scene.pedestrians.emplace_back(Pedestrian::Walk{.waypoints = {{0, 0}, {50, 0}}});
  const auto rays = RayScene::create(scene).value();
  const Pedestrian& person = scene.pedestrians.front();
  for (double t_s = 0; t_s < 1.5; t_s += 0.01) {
    rays->people().move(t_s, t_s + kInterval_s);
    const auto begin = person.body(t_s);
    const auto end = person.body(t_s + kInterval_s);
    for (const std::size_t shin : {1U, 7U}) {
      const auto middle = [&](const auto& body) -> Eigen::Vector3f {
        return 0.5F * (body[shin].start + body[shin].end);
      };
      const Eigen::Vector3f centre = 0.5F * (middle(begin) + middle(end));
      const float radius_m = 0.5F * (begin[shin].start_radius_m + begin[shin].end_radius_m);
      // From both sides: of two legs, one hides the other from one of them.
      float nearest_m = kBeside_m;
      for (const float side : {-1.0F, 1.0F}) {
        RayPacket packet;
        RayScene::reset(packet);
        Valid valid{};
        valid[0] = -1;
        aim(packet, 0, centre + Eigen::Vector3f{0, side * kBeside_m, 0}, {0, -side, 0});
        packet.ray.time[0] = 0.5F;
        rays->trace(valid, packet);
        nearest_m = std::min(nearest_m, std::abs(kBeside_m - radius_m - packet.ray.tfar[0]));
      }
      EXPECT_LT(nearest_m, 0.1F * radius_m) << t_s;
    }
  }
}

TEST(Camera, WhatTheRightInfraredCameraCannotSeeHasNoDepth) {
  Scene scene = daylight_scene();
  add_wall(scene, 4.0F, -40, 40, 0.6F);
  add_wall(scene, 1.0F, -0.3F, 0.3F, 0.6F);
  CameraOptions options = exact_options();
  options.depth_errors = true;
  const Rendered rendered =
      make(scene, options)->render(0, 0, [](double) { return looking(0, 0, 0); });
  // A post from 1 m before a wall at 4 m: 50 mm * 3 / 4 of the wall are hidden beside its left
  // edge, from the eye at 1 m 50 mm * f * (1/1 - 1/4) = 23 px of colour.
  const auto holes = [&](int from, int to) {
    int count = 0;
    for (int x = from; x < to; ++x) {
      count += depth_mm(rendered, x, 240) == 0 ? 1 : 0;
    }
    return count;
  };
  const int left_edge = static_cast<int>(315.6 - 608.8 * 0.3);
  const int right_edge = static_cast<int>(315.6 + 608.8 * 0.3);
  EXPECT_NEAR(holes(left_edge - 60, left_edge + 20), 23 - 608.8 * 0.015 * 0.75, 12.0);
  EXPECT_LT(holes(right_edge + 12, right_edge + 60), 4);
}

}  // namespace
}  // namespace geoflow::simulator::tests
