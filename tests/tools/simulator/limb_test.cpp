#include "src/limb.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/ray_scene.hpp"
#include "src/view.hpp"

namespace geoflow::simulator::tests {
namespace {

using Eigen::Vector3f;

Capsule forearm() {
  return {.start = {1.0F, -0.5F, 0.9F},
          .end = {1.2F, -0.4F, 0.7F},
          .start_radius_m = 0.05F,
          .end_radius_m = 0.035F};
}

Capsule moved(Capsule capsule, const Vector3f& by) {
  capsule.start += by;
  capsule.end += by;
  return capsule;
}

Vector3f any_direction(Random& random) {
  return Vector3f{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
}

/// Rays from all around, and from within, that pass the capsule's middle at up to three radii.
RayPacket rays_about(const Capsule& capsule, Random& random, float time) {
  const Vector3f middle = 0.5F * (capsule.start + capsule.end);
  RayPacket packet;
  RayScene::reset(packet);
  for (std::size_t i = 0; i < kPacket; ++i) {
    const float far_m = i < 2 ? 0.0F : 0.6F;
    const Vector3f from = middle + far_m * any_direction(random);
    aim(packet, i, from,
        middle + 3.0F * capsule.start_radius_m * any_direction(random) +
            (i < 2 ? Vector3f{0, 0, 1} : Vector3f{0, 0, 0}) - from);
    packet.ray.time[i] = time;
  }
  return packet;
}

/// The ray tracer has the same rod of facets where it stands still: every ray must say the same.
TEST(Limb, IsMetAsTheSameCapsuleThatStandsStill) {
  constexpr int kPackets = 500;
  constexpr float kEdge =
      1e-4F;  // of a ray's length: at an edge, rounding decides which facet it is
  Scene scene;
  scene.materials.emplace_back();
  scene.capsules.push_back(forearm());
  const auto rays = RayScene::create(scene).value();
  // It passes there in the middle of its way.
  const Vector3f way{0.1F, -0.3F, 0.05F};
  const Limb limb{moved(forearm(), -0.5F * way), moved(forearm(), 0.5F * way)};
  Valid all;
  all.fill(-1);
  Random random{7, "limb"};
  int hits = 0;
  int other = 0;
  for (int n = 0; n < kPackets; ++n) {
    RayPacket expected = rays_about(forearm(), random, 0.5F);
    RayPacket met = expected;
    rays->trace_static(all, expected);
    limb.stop(3, all, met);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const bool hit = expected.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
      const bool same = hit == (met.hit.geomID[i] == static_cast<unsigned>(HitKind::kPerson));
      const Vector3f normal{expected.hit.Ng_x[i], expected.hit.Ng_y[i], expected.hit.Ng_z[i]};
      const Vector3f own{met.hit.Ng_x[i], met.hit.Ng_y[i], met.hit.Ng_z[i]};
      if (!hit || !same) {
        other += same ? 0 : 1;
        continue;
      }
      ++hits;
      const bool near = std::abs(met.ray.tfar[i] - expected.ray.tfar[i]) < kEdge;
      const bool parallel = std::abs(normal.normalized().dot(own.normalized())) > 1.0F - kEdge;
      other += near && parallel ? 0 : 1;
      EXPECT_EQ(met.hit.primID[i], 3U);
    }
  }
  EXPECT_GT(hits, kPackets);
  EXPECT_LE(other, hits / 1000);
}

TEST(Limb, IsWhereTheRaysTimeHasIt) {
  const Vector3f way{0.0F, 0.4F, 0.0F};
  const Limb limb{forearm(), moved(forearm(), way)};
  RayPacket packet;
  RayScene::reset(packet);
  const Vector3f middle = 0.5F * (forearm().start + forearm().end);
  for (std::size_t i = 0; i < kPacket; ++i) {
    packet.ray.time[i] = static_cast<float>(i) / static_cast<float>(kPacket - 1);
    aim(packet, i, middle + packet.ray.time[i] * way - Vector3f{2, 0, 0}, Vector3f::UnitX());
  }
  Valid valid;
  valid.fill(-1);
  valid[4] = 0;
  limb.stop(0, valid, packet);
  for (std::size_t i = 0; i < kPacket; ++i) {
    const bool met = packet.hit.geomID[i] == static_cast<unsigned>(HitKind::kPerson);
    EXPECT_EQ(met, i != 4) << i;
    EXPECT_NEAR(met ? packet.ray.tfar[i] : packet.ray.tfar[0], packet.ray.tfar[0], 1e-5F) << i;
  }
  EXPECT_TRUE(limb.within().contains(forearm().start));
  EXPECT_TRUE(limb.within().contains(moved(forearm(), way).end));
}

TEST(Limb, LeavesRaysThatEndBeforeIt) {
  const Limb limb{forearm(), forearm()};
  RayPacket packet;
  RayScene::reset(packet);
  const Vector3f middle = 0.5F * (forearm().start + forearm().end);
  for (std::size_t i = 0; i < kPacket; ++i) {
    aim(packet, i, middle - Vector3f{2, 0, 0}, Vector3f::UnitX());
    packet.ray.tfar[i] = 1.5F;
  }
  Valid all;
  all.fill(-1);
  limb.stop(0, all, packet);
  EXPECT_EQ(std::ranges::count(packet.hit.geomID, RTC_INVALID_GEOMETRY_ID), kPacket);
}

}  // namespace
}  // namespace geoflow::simulator::tests
