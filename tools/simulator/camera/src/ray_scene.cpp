#include "src/ray_scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <vector>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/candidates.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr float kNear_m = 1e-3F;
constexpr float kGap_m = 2e-3F;
// A capsule's facets: rings of corners, from pole to pole. Embree's own round curves cost a second
// traversal of every ray.
constexpr std::size_t kSides = 10;
constexpr std::size_t kCapRings = 3;  // the pole, one between, the equator
constexpr std::size_t kRings = 2 * kCapRings;
constexpr std::size_t kFacets = (kRings - 1) * kSides;
constexpr std::size_t kCorners = kRings * kSides;

Vector3f axis_of(const Capsule& capsule) {
  constexpr float kShortest_m = 1e-6F;
  const Vector3f along = capsule.end - capsule.start;
  return along.norm() > kShortest_m ? Vector3f{along.normalized()} : Vector3f{Vector3f::UnitZ()};
}

/// A direction far from the capsule's, from which its rings' corners are counted.
Vector3f away_from(const Capsule& capsule) {
  constexpr float kSteep = 0.9F;
  return std::abs(axis_of(capsule).z()) < kSteep ? Vector3f::UnitZ() : Vector3f::UnitX();
}

void write_capsule(const Capsule& capsule, const Vector3f& away, float* out) {
  constexpr float kPi = std::numbers::pi_v<float>;
  const Vector3f axis = axis_of(capsule);
  const Vector3f side = away.cross(axis).normalized();
  const Vector3f other = axis.cross(side);
  for (std::size_t ring = 0; ring < kRings; ++ring) {
    const bool first = ring < kCapRings;
    const float radius = first ? capsule.start_radius_m : capsule.end_radius_m;
    const std::size_t from_equator = first ? kCapRings - 1 - ring : ring - kCapRings;
    const float latitude =
        0.5F * kPi * static_cast<float>(from_equator) / static_cast<float>(kCapRings - 1);
    const Vector3f centre = (first ? capsule.start : capsule.end) +
                            (first ? -1.0F : 1.0F) * radius * std::sin(latitude) * axis;
    for (std::size_t i = 0; i < kSides; ++i) {
      const float turn = 2.0F * kPi * static_cast<float>(i) / static_cast<float>(kSides);
      const Vector3f corner =
          centre + radius * std::cos(latitude) * (std::cos(turn) * side + std::sin(turn) * other);
      out = std::ranges::copy(std::span{corner.data(), 3}, out).out;
    }
  }
}

float* new_corners(RTCGeometry geometry, std::size_t count) {
  return static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                     RTC_FORMAT_FLOAT3, 3 * sizeof(float), count));
}

unsigned* new_quads(RTCGeometry geometry, std::size_t count) {
  return static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 4 * sizeof(unsigned), count));
}

void set_facets(RTCGeometry geometry, std::size_t capsules) {
  unsigned* out = new_quads(geometry, capsules * kFacets);
  for (std::size_t capsule = 0; capsule < capsules; ++capsule) {
    for (std::size_t facet = 0; facet < kFacets; ++facet) {
      const std::size_t ring = capsule * kCorners + facet / kSides * kSides;
      const std::size_t here = facet % kSides;
      const std::size_t next = (here + 1) % kSides;
      for (const std::size_t corner :
           {ring + here, ring + next, ring + kSides + next, ring + kSides + here}) {
        *out++ = static_cast<unsigned>(corner);
      }
    }
  }
}

void attach(RTCScene scene, RTCGeometry geometry, HitKind kind) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, static_cast<unsigned>(kind));
}

void intersect(RTCScene scene, const Valid& valid, RayPacket& packet) {
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  // Embree reads both as whole vectors.
  constexpr std::size_t kVectorBytes = 64;
  alignas(kVectorBytes) const Valid aligned = valid;
  rtcIntersect16(aligned.data(), scene, &context, &packet);
}

}  // namespace

Result<std::unique_ptr<RayScene>> RayScene::create(const Scene& scene) {
  std::unique_ptr<RayScene> made{new RayScene{scene}};
  made->device_.reset(rtcNewDevice(nullptr));
  if (!made->device_) {
    return fail(ErrorCode::kSystem, "Embree does not start (error {})",
                static_cast<int>(rtcGetDeviceError(nullptr)));
  }
  made->standing_.reset(rtcNewScene(made->device_.get()));
  // It is built once and traced millions of times a frame.
  rtcSetSceneBuildQuality(made->standing_.get(), RTC_BUILD_QUALITY_HIGH);
  // Rays between two facets that touch meet one of them.
  rtcSetSceneFlags(made->standing_.get(), RTC_SCENE_FLAG_ROBUST);
  made->add_patches();
  made->add_capsules();
  rtcCommitScene(made->standing_.get());
  const RTCError error = rtcGetDeviceError(made->device_.get());
  if (error != RTC_ERROR_NONE) {
    return fail(ErrorCode::kSystem, "Embree refuses the scene {} (error {})", scene.name,
                static_cast<int>(error));
  }
  return made;
}

void RayScene::add_patches() {
  const std::vector<Patch>& patches = scene_->patches;
  const Owned<RTCGeometry> geometry{rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_QUAD)};
  float* vertices = new_corners(geometry.get(), 4 * patches.size());
  unsigned* indices = new_quads(geometry.get(), patches.size());
  unsigned next = 0;
  for (const Patch& patch : patches) {
    for (const Vector3f& corner : patch.corners) {
      std::ranges::copy(std::span{corner.data(), 3}, vertices + 3 * static_cast<std::size_t>(next));
      indices[next] = next;
      ++next;
    }
  }
  attach(standing_.get(), geometry.get(), HitKind::kPatch);
}

void RayScene::add_capsules() {
  const std::vector<Capsule>& capsules = scene_->capsules;
  if (capsules.empty()) {
    return;
  }
  const Owned<RTCGeometry> geometry{rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_QUAD)};
  float* vertices = new_corners(geometry.get(), kCorners * capsules.size());
  for (std::size_t i = 0; i < capsules.size(); ++i) {
    write_capsule(capsules[i], away_from(capsules[i]), vertices + 3 * kCorners * i);
  }
  set_facets(geometry.get(), capsules.size());
  attach(standing_.get(), geometry.get(), HitKind::kCapsule);
}

std::size_t RayScene::primitive(const RayPacket& packet, std::size_t lane) {
  const std::size_t number = packet.hit.primID[lane];
  return packet.hit.geomID[lane] == static_cast<unsigned>(HitKind::kCapsule) ? number / kFacets
                                                                             : number;
}

void RayScene::reset(RayPacket& packet) {
  renew(packet);
  std::ranges::fill(packet.ray.time, 0.0F);
}

void RayScene::renew(RayPacket& packet) {
  for (std::size_t i = 0; i < kPacket; ++i) {
    packet.ray.tnear[i] = kNear_m;
    packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
    packet.ray.mask[i] = ~0U;
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

void RayScene::trace(const Valid& valid, RayPacket& packet) const {
  intersect(standing_.get(), valid, packet);
  people_.stop(valid, packet);
}

void RayScene::trace_among(const Candidates& candidates, const Valid& valid,
                           RayPacket& packet) const {
  if (candidates.anything()) {
    trace(valid, packet);
    return;
  }
  for (const std::uint32_t patch : candidates.patches()) {
    flats_[patch].stop(patch, packet);
  }
  if (!candidates.nothing()) {
    trace_gaps(valid, packet);
  }
  if (candidates.people()) {
    people_.stop(valid, packet);
  }
}

void RayScene::trace_gaps(const Valid& valid, RayPacket& packet) const {
  Valid left = valid;
  bool any = false;
  for (std::size_t i = 0; i < kPacket; ++i) {
    left[i] = packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? valid[i] : 0;
    any = any || left[i] != 0;
  }
  if (any) {
    trace_static(left, packet);
  }
}

void RayScene::trace_static(const Valid& valid, RayPacket& packet) const {
  intersect(standing_.get(), valid, packet);
}

bool RayScene::blocked(const Vector3f& from, const Vector3f& to) const {
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  const float distance = (to - from).norm();
  const Vector3f direction = (to - from) / distance;
  RTCRay ray{};
  ray.org_x = from.x();
  ray.org_y = from.y();
  ray.org_z = from.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tnear = kGap_m;
  ray.tfar = distance - kGap_m;
  ray.mask = ~0U;
  rtcOccluded1(standing_.get(), &context, &ray);
  return ray.tfar < 0;
}

}  // namespace geoflow::simulator
