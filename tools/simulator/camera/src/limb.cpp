#include "src/limb.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/ray_scene.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// A direction far from a capsule's, from which its sides are counted.
Vector3f away_from(const Capsule& capsule) {
  constexpr float kSteep = 0.9F;
  return std::abs((capsule.end - capsule.start).normalized().z()) < kSteep ? Vector3f::UnitZ()
                                                                           : Vector3f::UnitX();
}

/// A box about a ball, with room for rounding.
Eigen::AlignedBox3f around(const Vector3f& centre, float radius_m) {
  constexpr float kRounding_m = 1e-3F;
  const Vector3f half = Vector3f::Constant(radius_m + kRounding_m);
  return {centre - half, centre + half};
}

struct Triple {
  float x;
  float y;
  float z;
};
[[gnu::always_inline]] inline Triple at(float time, const Vector3f& begin, const Vector3f& change) {
  return {.x = begin[0] + time * change[0],
          .y = begin[1] + time * change[1],
          .z = begin[2] + time * change[2]};
}
[[gnu::always_inline]] inline Triple cross(const Triple& a, const Triple& b) {
  return {.x = a.y * b.z - a.z * b.y, .y = a.z * b.x - a.x * b.z, .z = a.x * b.y - a.y * b.x};
}
[[gnu::always_inline]] inline float dot(const Triple& a, const Triple& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// A triple for each lane.
struct TripleLanes {
  Lanes x;
  Lanes y;
  Lanes z;

  [[gnu::always_inline]] void set(std::size_t lane, const Triple& triple) {
    x[lane] = triple.x;
    y[lane] = triple.y;
    z[lane] = triple.z;
  }
  [[nodiscard, gnu::always_inline]] float dot(std::size_t lane, const Vector3f& other) const {
    return other[0] * x[lane] + other[1] * y[lane] + other[2] * z[lane];
  }
};

/// Rays in a limb's axes, and for how long they are within its planes.
struct Passage {
  // Rows of what takes world to the limb's axes, times its determinant: `out` times them is a
  // face's normal in world.
  TripleLanes row_x;
  TripleLanes row_y;
  TripleLanes row_z;
  TripleLanes from;
  TripleLanes along;
  Lanes enters;
  Lanes leaves;
  std::array<int, kLanes> met;   ///< the face that is crossed inwards last
  std::array<int, kLanes> left;  ///< that is crossed outwards first
};

}  // namespace

Limb::Axes::Axes(const Capsule& capsule, const Vector3f& away)
    : start{capsule.start},
      side{away.cross(capsule.end - capsule.start).normalized()},
      other{(capsule.end - capsule.start).normalized().cross(side)},
      axis{(capsule.end - capsule.start).normalized()} {}

Limb::Limb(const Capsule& begin, const Capsule& end)
    // Sides of both are counted alike: else a limb between the two would be wrung out thin.
    : begin_{begin, away_from(begin)},
      change_{end, away_from(begin)},
      length_m_{(begin.end - begin.start).norm()},
      faces_{} {
  change_.start -= begin_.start;
  change_.side -= begin_.side;
  change_.other -= begin_.other;
  change_.axis -= begin_.axis;
  for (const Capsule& capsule : {begin, end}) {
    within_.extend(around(capsule.start, capsule.start_radius_m));
    within_.extend(around(capsule.end, capsule.end_radius_m));
  }
  constexpr float kPi = std::numbers::pi_v<float>;
  constexpr float kEighth = std::numbers::sqrt2_v<float> / 2.0F;  // cosine and sine of 45 degrees
  // Rings of corners, from pole to pole: their radius, and their place along the axis.
  const float start_m = begin.start_radius_m;
  const float end_m = begin.end_radius_m;
  const std::array<std::pair<float, float>, kBands + 1> rings{
      {{0.0F, -start_m},
       {kEighth * start_m, -kEighth * start_m},
       {start_m, 0.0F},
       {end_m, length_m_},
       {kEighth * end_m, length_m_ + kEighth * end_m},
       {0.0F, length_m_ + end_m}}};
  constexpr std::array<std::size_t, kBands> kOrder{2, 0, 1, 3, 4};
  const float middle = std::cos(kPi / static_cast<float>(kSides));  // of a side, over its corners
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const auto [near_m, low_m] = rings[kOrder[i / kSides]];
    const auto [far_m, high_m] = rings[kOrder[i / kSides] + 1];
    const float turn =
        kPi * (2.0F * static_cast<float>(i % kSides) + 1.0F) / static_cast<float>(kSides);
    const float across = high_m - low_m;
    const float along = middle * (near_m - far_m);
    faces_[i] = {.out = {across * std::cos(turn), across * std::sin(turn), along},
                 .reach = across * middle * near_m + along * low_m};
  }
}

void Limb::stop(std::uint32_t number, const Valid& valid, RTCRayHit16& packet) const {
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // Copies, because what lies behind a reference might change with every ray that is written.
    const RTCRay16 ray = packet.ray;
    const Axes begin = begin_;
    const Axes change = change_;
    Passage way;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float time = ray.time[i];
      const Triple start = at(time, begin.start, change.start);
      const Triple side = at(time, begin.side, change.side);
      const Triple other = at(time, begin.other, change.other);
      const Triple axis = at(time, begin.axis, change.axis);
      const Triple row_x = cross(other, axis);
      const Triple row_y = cross(axis, side);
      const Triple row_z = cross(side, other);
      const float inverse = 1.0F / dot(side, row_x);
      const Triple from{
          .x = ray.org_x[i] - start.x, .y = ray.org_y[i] - start.y, .z = ray.org_z[i] - start.z};
      const Triple along{.x = ray.dir_x[i], .y = ray.dir_y[i], .z = ray.dir_z[i]};
      way.row_x.set(i, row_x);
      way.row_y.set(i, row_y);
      way.row_z.set(i, row_z);
      way.from.set(i, {.x = inverse * dot(row_x, from),
                       .y = inverse * dot(row_y, from),
                       .z = inverse * dot(row_z, from)});
      way.along.set(i, {.x = inverse * dot(row_x, along),
                        .y = inverse * dot(row_y, along),
                        .z = inverse * dot(row_z, along)});
      way.enters[i] = -kInfinity;
      way.leaves[i] = kInfinity;
      way.met[i] = 0;
      way.left[i] = 0;
    }
    const auto cross_faces = [&](std::size_t first,
                                 std::size_t last) __attribute__((always_inline)) {
      for (std::size_t number_of_face = first; number_of_face < last; ++number_of_face) {
        const Face face = faces_[number_of_face];
        const auto here = static_cast<int>(number_of_face);
        for (std::size_t i = 0; i < kLanes; ++i) {
          const float room = face.reach - way.from.dot(i, face.out);
          const float rate = way.along.dot(i, face.out);
          const float t = room / rate;
          const bool inwards = rate < 0.0F && t > way.enters[i];
          const bool outwards = rate >= 0.0F && t < way.leaves[i];
          way.enters[i] = inwards ? t : way.enters[i];
          way.met[i] = inwards ? here : way.met[i];
          way.leaves[i] = outwards ? t : way.leaves[i];
          way.left[i] = outwards ? here : way.left[i];
        }
      }
    };
    cross_faces(0, kSides);
    // Where rays come in through the rod's own sides, its ends do not matter.
    int open = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float place_m = way.from.z[i] + way.enters[i] * way.along.z[i];
      const bool misses = way.enters[i] > way.leaves[i];
      const bool on_rod = way.enters[i] > ray.tnear[i] && place_m >= 0.0F && place_m <= length_m_;
      open |= misses || on_rod ? 0 : valid[i];
    }
    if (open != 0) {
      cross_faces(kSides, faces_.size());
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      const bool from_outside = way.enters[i] > ray.tnear[i];
      const float t = from_outside ? way.enters[i] : way.leaves[i];
      if (valid[i] == 0 || way.enters[i] > way.leaves[i] || t <= ray.tnear[i] || t >= ray.tfar[i]) {
        continue;
      }
      const auto face = static_cast<std::size_t>(from_outside ? way.met[i] : way.left[i]);
      const Vector3f& out = faces_[face].out;
      packet.ray.tfar[i] = t;
      packet.hit.geomID[i] = static_cast<unsigned>(HitKind::kPerson);
      packet.hit.primID[i] = number;
      packet.hit.Ng_x[i] =
          out[0] * way.row_x.x[i] + out[1] * way.row_y.x[i] + out[2] * way.row_z.x[i];
      packet.hit.Ng_y[i] =
          out[0] * way.row_x.y[i] + out[1] * way.row_y.y[i] + out[2] * way.row_z.y[i];
      packet.hit.Ng_z[i] =
          out[0] * way.row_x.z[i] + out[1] * way.row_y.z[i] + out[2] * way.row_z.z[i];
    }
  });
}

}  // namespace geoflow::simulator
