#include "src/ray_scene.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <embree3/rtcore.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/scene.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr float kNear_m = 1e-3F;
constexpr float kGap_m = 2e-3F;
constexpr std::size_t kCapsuleFloats = 8;  // two ends of x, y, z, radius

void write_capsule(const Capsule& capsule, float* out) {
  const std::array<float, kCapsuleFloats> values{
      capsule.start.x(), capsule.start.y(), capsule.start.z(), capsule.start_radius_m,
      capsule.end.x(),   capsule.end.y(),   capsule.end.z(),   capsule.end_radius_m};
  std::ranges::copy(values, out);
}

float* new_vertices(RTCGeometry geometry, unsigned slot, std::size_t capsules) {
  return static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, slot, RTC_FORMAT_FLOAT4,
                              kCapsuleFloats / 2 * sizeof(float), 2 * capsules));
}

/// One segment a capsule, each with round ends.
void set_segments(RTCGeometry geometry, std::size_t capsules) {
  auto* first = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(unsigned), capsules));
  for (std::size_t i = 0; i < capsules; ++i) {
    first[i] = static_cast<unsigned>(2 * i);
  }
}

void intersect(RTCScene scene, const std::array<int, kPacket>& valid, RayPacket& packet) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  // Embree reads both as whole vectors.
  constexpr std::size_t kVectorBytes = 64;
  alignas(kVectorBytes) const std::array<int, kPacket> aligned = valid;
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
  made->all_.reset(rtcNewScene(made->device_.get()));
  if (!scene.pedestrians.empty()) {
    rtcSetSceneFlags(made->all_.get(), RTC_SCENE_FLAG_DYNAMIC);
    made->standing_.reset(rtcNewScene(made->device_.get()));
  }
  made->add_patches();
  made->add_capsules();
  made->add_people();
  if (made->standing_) {
    rtcCommitScene(made->standing_.get());
  }
  rtcCommitScene(made->all_.get());
  const RTCError error = rtcGetDeviceError(made->device_.get());
  if (error != RTC_ERROR_NONE) {
    return fail(ErrorCode::kSystem, "Embree refuses the scene {} (error {})", scene.name,
                static_cast<int>(error));
  }
  return made;
}

void RayScene::attach(RTCGeometry geometry, HitKind kind, bool moves) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(all_.get(), geometry, static_cast<unsigned>(kind));
  if (standing_ && !moves) {
    rtcAttachGeometryByID(standing_.get(), geometry, static_cast<unsigned>(kind));
  }
}

void RayScene::add_patches() {
  const std::vector<Patch>& patches = scene_->patches;
  const Owned<RTCGeometry> geometry{rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_QUAD)};
  auto* vertices = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), 4 * patches.size()));
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                              4 * sizeof(unsigned), patches.size()));
  unsigned next = 0;
  for (const Patch& patch : patches) {
    for (const Vector3f& corner : patch.corners) {
      std::ranges::copy(std::span{corner.data(), 3}, vertices + 3 * static_cast<std::size_t>(next));
      indices[next] = next;
      ++next;
    }
  }
  attach(geometry.get(), HitKind::kPatch, false);
}

void RayScene::add_capsules() {
  const std::vector<Capsule>& capsules = scene_->capsules;
  if (capsules.empty()) {
    return;
  }
  const Owned<RTCGeometry> geometry{
      rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE)};
  float* vertices = new_vertices(geometry.get(), 0, capsules.size());
  for (std::size_t i = 0; i < capsules.size(); ++i) {
    write_capsule(capsules[i], vertices + kCapsuleFloats * i);
  }
  set_segments(geometry.get(), capsules.size());
  attach(geometry.get(), HitKind::kCapsule, false);
}

void RayScene::add_people() {
  const std::size_t count = scene_->pedestrians.size() * Pedestrian::kCapsules;
  if (count == 0) {
    return;
  }
  people_.reset(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE));
  rtcSetGeometryTimeStepCount(people_.get(), 2);
  people_begin_.resize(count);
  people_vertices_ = {new_vertices(people_.get(), 0, count), new_vertices(people_.get(), 1, count)};
  set_segments(people_.get(), count);
  move_people(0, 0);
  attach(people_.get(), HitKind::kPerson, true);
}

void RayScene::move_people(double begin_s, double end_s) {
  if (!people_) {
    return;
  }
  std::size_t next = 0;
  for (const Pedestrian& person : scene_->pedestrians) {
    const auto begin = person.body(begin_s);
    const auto end = person.body(end_s);
    for (std::size_t i = 0; i < begin.size(); ++i, ++next) {
      write_capsule(begin[i], people_vertices_[0] + kCapsuleFloats * next);
      write_capsule(end[i], people_vertices_[1] + kCapsuleFloats * next);
      people_begin_[next] = begin[i];
    }
  }
  rtcUpdateGeometryBuffer(people_.get(), RTC_BUFFER_TYPE_VERTEX, 0);
  rtcUpdateGeometryBuffer(people_.get(), RTC_BUFFER_TYPE_VERTEX, 1);
  rtcCommitGeometry(people_.get());
  rtcCommitScene(all_.get());
}

void RayScene::reset(RayPacket& packet) {
  for (std::size_t i = 0; i < kPacket; ++i) {
    packet.ray.tnear[i] = kNear_m;
    packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
    packet.ray.time[i] = 0;
    packet.ray.mask[i] = ~0U;
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

void RayScene::trace(const std::array<int, kPacket>& valid, RayPacket& packet) const {
  intersect(all_.get(), valid, packet);
}

void RayScene::trace_static(const std::array<int, kPacket>& valid, RayPacket& packet) const {
  intersect(standing_ ? standing_.get() : all_.get(), valid, packet);
}

bool RayScene::blocked(const Vector3f& from, const Vector3f& to) const {
  RTCIntersectContext context;
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
  rtcOccluded1(standing_ ? standing_.get() : all_.get(), &context, &ray);
  return ray.tfar < 0;
}

}  // namespace geoflow::simulator
