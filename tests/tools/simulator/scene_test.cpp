#include "geoflow/tools/simulator/scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/texture.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kClearance_m = 0.4F;
constexpr float kRobotHeight_m = 0.6F;
constexpr float kFlat_m = 0.01F;  // markings on the floor are walked over

float distance_to_path(const Vector2f& point, const std::vector<Vector2d>& path) {
  float nearest = std::numeric_limits<float>::infinity();
  for (std::size_t i = 1; i < path.size(); ++i) {
    const Vector2f start = path[i - 1].cast<float>();
    const Vector2f leg = path[i].cast<float>() - start;
    const float along = std::clamp((point - start).dot(leg) / leg.squaredNorm(), 0.0F, 1.0F);
    nearest = std::min(nearest, (point - start - along * leg).norm());
  }
  return nearest;
}

bool in_the_way(const Vector3f& point) {
  return point.z() > kFlat_m && point.z() < kRobotHeight_m;
}

/// The least distance from the path to what stands in a robot's way, by samples 4 cm apart.
float clearance(const Scene& scene) {
  constexpr float kStep_m = 0.04F;
  float least = std::numeric_limits<float>::infinity();
  for (const Patch& patch : scene.patches) {
    const int columns = 1 + static_cast<int>(std::ceil(patch.size_m.x() / kStep_m));
    const int rows = 1 + static_cast<int>(std::ceil(patch.size_m.y() / kStep_m));
    for (int i = 0; i <= columns * rows; ++i) {
      const int column = i % columns;
      const int row = i / columns;
      const float u = patch.size_m.x() * static_cast<float>(column) /
                      static_cast<float>(std::max(1, columns - 1));
      const float v = patch.size_m.y() * static_cast<float>(row) / static_cast<float>(rows);
      const Vector3f point = patch.origin + u * patch.axis_u + v * patch.axis_v;
      if (in_the_way(point)) {
        least = std::min(least, distance_to_path(point.head<2>(), scene.waypoints));
      }
    }
  }
  for (const Capsule& capsule : scene.capsules) {
    for (int i = 0; i <= 8; ++i) {
      const float along = static_cast<float>(i) / 8.0F;
      const Vector3f point = capsule.start + along * (capsule.end - capsule.start);
      const float radius = std::max(capsule.start_radius_m, capsule.end_radius_m);
      if (point.z() - radius < kRobotHeight_m) {
        least = std::min(least, distance_to_path(point.head<2>(), scene.waypoints) - radius);
      }
    }
  }
  return least;
}

double length(const std::vector<Vector2d>& path) {
  double sum = 0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    sum += (path[i] - path[i - 1]).norm();
  }
  return sum;
}

class EveryScene : public testing::TestWithParam<std::string_view> {};

TEST_P(EveryScene, HasAPathThatARobotCanWalkWhateverTheSeed) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Scene scene = make_scene(GetParam(), seed, {}).value();
    ASSERT_GE(scene.waypoints.size(), 2U);
    EXPECT_GE(clearance(scene), kClearance_m) << "seed " << seed;
    EXPECT_GE(length(scene.waypoints), 10.0) << "seed " << seed;
    EXPECT_EQ(scene.closed, (scene.waypoints.front() - scene.waypoints.back()).norm() < 1e-9)
        << "seed " << seed;
  }
}

TEST_P(EveryScene, IsLitAndWellFormed) {
  const Scene scene = make_scene(GetParam(), 3, {}).value();
  EXPECT_TRUE(!scene.lights.empty() || scene.daylight.has_value());
  for (const Patch& patch : scene.patches) {
    EXPECT_LT(static_cast<std::size_t>(patch.material), scene.materials.size());
    EXPECT_NEAR(patch.axis_u.norm(), 1.0F, 1e-4F);
    EXPECT_NEAR(patch.axis_v.norm(), 1.0F, 1e-4F);
    EXPECT_NEAR(patch.axis_u.dot(patch.axis_v), 0.0F, 1e-4F);
    EXPECT_GT(patch.size_m.minCoeff(), 0.0F);
    for (const Vector3f& corner : patch.corners) {
      EXPECT_NEAR((corner - patch.origin).dot(patch.normal()), 0.0F, 2e-3F) << "not planar";
    }
  }
  for (const Material& material : scene.materials) {
    EXPECT_LT(material.texture, static_cast<int>(scene.textures.size()));
    EXPECT_LE(luminance(material.albedo), 1.0F);
  }
}

TEST_P(EveryScene, DependsOnItsSeedAlone) {
  const Scene one = make_scene(GetParam(), 7, {}).value();
  const Scene same = make_scene(GetParam(), 7, {}).value();
  const Scene other = make_scene(GetParam(), 8, {}).value();
  const auto corners = [](const Scene& scene) {
    std::vector<float> all;
    for (const Patch& patch : scene.patches) {
      for (const Vector3f& corner : patch.corners) {
        all.insert(all.end(), corner.begin(), corner.end());
      }
    }
    return all;
  };
  EXPECT_EQ(corners(one), corners(same));
  EXPECT_NE(corners(one), corners(other));
  EXPECT_EQ(one.waypoints, same.waypoints);
}

std::vector<std::string_view> names() {
  std::vector<std::string_view> all;
  for (const SceneInfo& info : scenes()) {
    all.push_back(info.name);
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene, testing::ValuesIn(names()),
                         [](const auto& each) { return std::string{each.param}; });

TEST(MakeScene, NamesTheNearestSceneForAnUnknownOne) {
  const auto made = make_scene("ofice", 1, {});
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message.find("office"), std::string::npos);
}

TEST(MakeScene, HasAsManyPedestriansAsAsked) {
  EXPECT_EQ(make_scene("corridor", 1, {}).value().pedestrians.size(), 3U);
  EXPECT_EQ(make_scene("corridor", 1, {.pedestrians = 7}).value().pedestrians.size(), 7U);
  EXPECT_EQ(make_scene("office", 1, {.pedestrians = 2}).value().pedestrians.size(), 2U);
}

TEST(Pedestrian, WalksItsLineToAndFroAtItsSpeed) {
  const Pedestrian walker{{.waypoints = {{0, 0}, {4, 0}, {4, 3}}, .speed_mps = 1.0F, .start_m = 0}};
  EXPECT_LT((walker.position(2.0) - Vector2f{2, 0}).norm(), 1e-4F);
  EXPECT_LT((walker.position(5.0) - Vector2f{4, 1}).norm(), 1e-4F);
  EXPECT_LT((walker.position(9.0) - Vector2f{4, 1}).norm(), 1e-4F);
  EXPECT_LT((walker.position(16.0) - Vector2f{2, 0}).norm(), 1e-4F);
  EXPECT_LT((walker.position(-1.0) - Vector2f{1, 0}).norm(), 1e-4F);
}

TEST(Pedestrian, StandsOnTheFloorAndIsAsTallAsSaid) {
  const Pedestrian walker{{.waypoints = {{0, 0}, {40, 0}}, .speed_mps = 1.3F, .height_m = 1.8F}};
  for (double t_s = 0; t_s < 3; t_s += 0.05) {
    float low = 10;
    float high = 0;
    for (const Capsule& part : walker.body(t_s)) {
      low = std::min({low, part.start.z() - part.start_radius_m, part.end.z() - part.end_radius_m});
      high = std::max(high, part.end.z() + part.end_radius_m);
    }
    EXPECT_NEAR(low, 0.0F, 0.12F) << t_s;
    EXPECT_NEAR(high, 1.8F, 0.06F) << t_s;
  }
}

}  // namespace
}  // namespace geoflow::simulator
