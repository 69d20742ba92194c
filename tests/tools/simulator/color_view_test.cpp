#include "src/color_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "camera_rig.hpp"
#include "src/lighting.hpp"
#include "src/ray_scene.hpp"
#include "src/shader.hpp"
#include "src/steady_tiles.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

// What the renderer leaves out, against what it would see with it.
namespace geoflow::simulator::tests {
namespace {

/// A view that turns and shakes as a trotting robot's: 1 rad/s and 40 rad/s^2.
SE3 trotting(const Scene& scene, double t_s) {
  constexpr double kShake_radps = 2 * std::numbers::pi * 6.0;
  const Vector2d start = scene.path()[0];
  const Vector2d heading = (scene.path()[1] - start).normalized();
  const Vector2d at = start + (1.0 + 0.8 * t_s) * heading;
  return looking(at.x(), at.y(), std::atan2(heading.y(), heading.x()) + t_s,
                 0.05 + 0.028 * std::sin(kShake_radps * t_s));
}

class SteadyTilesOf : public testing::TestWithParam<const char*> {};

TEST_P(SteadyTilesOf, AnExposureSeesWhatTracingEveryRaySees) {
  constexpr Shutter kShutter{.t_mid_s = 0.4, .exposure_s = 0.02, .readout_s = 0.02, .rows = 480};
  constexpr float kOther = 0.02F;  // of a pixel's light
  // A rounding error in where a ray ends decides what is seen at an edge in a mirror: without them.
  const Scene scene = make_scene(GetParam(), 3, {.reflectivity = 0}).value();
  const auto rays = RayScene::create(scene).value();
  rays->people().move(kShutter.begin_s(), kShutter.end_s());
  const Lighting lighting{scene, *rays};
  Shader shader{scene, *rays, lighting};
  shader.move_people(kShutter.t_mid_s);
  const Subject subject{.scene = scene, .rays = *rays, .shader = shader};
  const CameraIntrinsics intrinsics = d435i_color_intrinsics(640, 480);
  const auto pose = [&](double t_s) { return trotting(scene, t_s); };
  const std::vector<Rgb> quick =
      expose(subject, intrinsics, kShutter, pose, {.rays_a_pixel = 4, .key = 5});
  const std::vector<Rgb> whole =
      expose(subject, intrinsics, kShutter, pose, {.rays_a_pixel = 4, .key = 5, .trace_all = true});
  ASSERT_EQ(quick.size(), whole.size());
  std::size_t other = 0;
  for (std::size_t i = 0; i < quick.size(); ++i) {
    const float difference = std::abs(luminance(quick[i]) - luminance(whole[i]));
    other += difference > kOther * luminance(whole[i]) ? 1U : 0U;
  }
  std::cout << GetParam() << ": " << other << " of " << quick.size() << " pixels differ by 2 %\n";
  // Slivers thinner than a pixel at the horizon may be missed by the ray a pixel that looks for
  // what is there.
  EXPECT_LT(other, quick.size() / 10'000);

  // And it does leave something out.
  const Pinhole pinhole{intrinsics};
  const ViewTrack track{kShutter.begin_s(), kShutter.end_s(), pose};
  const SteadyTiles steady{*rays, pinhole, kShutter, intrinsics.width, track};
  int count = 0;
  for (int top = 0; top < 480; top += kTile) {
    for (int left = 0; left < 640; left += kTile) {
      count += steady.at({.left = left, .top = top}) != SteadyTiles::kMixed ? 1 : 0;
    }
  }
  std::cout << GetParam() << ": " << count << " of 19200 tiles are steady\n";
  EXPECT_GT(count, 19200 / 4);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SteadyTilesOf,
                         testing::Values("office", "corridor", "parking", "plaza"));

TEST(ViewTrack, IsWithinATenthOfAPixelOfTheWay) {
  constexpr double kFocal_px = 608.8;
  // As a foot hits the ground: 200 rad/s^2 at 30 Hz.
  constexpr double kRing_radps = 2 * std::numbers::pi * 30.0;
  constexpr double kRing_rad = 200.0 / (kRing_radps * kRing_radps);
  const auto pose = [](double t_s) {
    return looking(0.8 * t_s, 0, t_s, kRing_rad * std::sin(kRing_radps * t_s));
  };
  const ViewTrack track{0.1, 0.153, pose};
  double worst_px = 0;
  for (double t_s = 0.1; t_s < 0.153; t_s += 1.1e-4) {
    const Eigen::Matrix3f exact = pose(t_s).rotation_matrix().cast<float>();
    const Eigen::Vector3f corner{0.53F, 0.4F, 1.0F};
    const Eigen::Vector3f seen = exact.transpose() * (track.at(t_s).R_world_cam * corner);
    worst_px = std::max(
        worst_px, kFocal_px * static_cast<double>((seen / seen.z() - corner).head<2>().norm()));
  }
  std::cout << "a track of millisecond steps: within " << worst_px << " px\n";
  EXPECT_LT(worst_px, 0.1);
}

}  // namespace
}  // namespace geoflow::simulator::tests
