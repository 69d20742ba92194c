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
      faces_{faces_of(begin)} {
  change_.start -= begin_.start;
  change_.side -= begin_.side;
  change_.other -= begin_.other;
  change_.axis -= begin_.axis;
  for (const Capsule& capsule : {begin, end}) {
    within_.extend(around(capsule.start, capsule.start_radius_m));
    within_.extend(around(capsule.end, capsule.end_radius_m));
  }
}

std::array<Limb::Face, Limb::kBands * Limb::kSides> Limb::faces_of(const Capsule& capsule) {
  const float length_m = (capsule.end - capsule.start).norm();
  constexpr float kPi = std::numbers::pi_v<float>;
  constexpr float kEighth = std::numbers::sqrt2_v<float> / 2.0F;  // cosine and sine of 45 degrees
  // Rings of corners, from pole to pole: their radius, and their place along the axis.
  const float start_m = capsule.start_radius_m;
  const float end_m = capsule.end_radius_m;
  const std::array<std::pair<float, float>, kBands + 1> rings{
      {{0.0F, -start_m},
       {kEighth * start_m, -kEighth * start_m},
       {start_m, 0.0F},
       {end_m, length_m},
       {kEighth * end_m, length_m + kEighth * end_m},
       {0.0F, length_m + end_m}}};
  std::array<Face, kBands * kSides> faces{};
  constexpr std::array<std::size_t, kBands> kOrder{2, 0, 1, 3, 4};
  const float middle = std::cos(kPi / static_cast<float>(kSides));  // of a side, over its corners
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const auto [near_m, low_m] = rings[kOrder[i / kSides]];
    const auto [far_m, high_m] = rings[kOrder[i / kSides] + 1];
    const float turn =
        kPi * (2.0F * static_cast<float>(i % kSides) + 1.0F) / static_cast<float>(kSides);
    const float across = high_m - low_m;
    const float along = middle * (near_m - far_m);
    faces[i] = {.out = {across * std::cos(turn), across * std::sin(turn), along},
                .reach = across * middle * near_m + along * low_m};
  }
  return faces;
}

/// Rays in a limb's axes, and for how long they are within its faces.
struct Limb::Passage {
  RTCRay16 ray;
  Valid valid;
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

  // Copies of the axes: what lies behind a reference might change with every number that is set.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init,performance-unnecessary-value-param)
  [[gnu::always_inline]] Passage(const RTCRay16& rays, const Valid& lanes, Axes begin, Axes change)
      : ray{rays}, valid{lanes} {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float time = ray.time[i];
      const Triple start = at(time, begin.start, change.start);
      const Triple side = at(time, begin.side, change.side);
      const Triple other = at(time, begin.other, change.other);
      const Triple axis = at(time, begin.axis, change.axis);
      const Triple x = cross(other, axis);
      const Triple y = cross(axis, side);
      const Triple z = cross(side, other);
      const float inverse = 1.0F / dot(side, x);
      const Triple away{
          .x = ray.org_x[i] - start.x, .y = ray.org_y[i] - start.y, .z = ray.org_z[i] - start.z};
      const Triple towards{.x = ray.dir_x[i], .y = ray.dir_y[i], .z = ray.dir_z[i]};
      row_x.set(i, x);
      row_y.set(i, y);
      row_z.set(i, z);
      from.set(
          i,
          {.x = inverse * dot(x, away), .y = inverse * dot(y, away), .z = inverse * dot(z, away)});
      along.set(i, {.x = inverse * dot(x, towards),
                    .y = inverse * dot(y, towards),
                    .z = inverse * dot(z, towards)});
      enters[i] = -kInfinity;
      leaves[i] = kInfinity;
      met[i] = 0;
      left[i] = 0;
    }
  }

  [[gnu::always_inline]] void cross_face(const Face& crossed, int number) {
    // NOLINTNEXTLINE(performance-unnecessary-copy-initialization): as the axes
    const Face face = crossed;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float room = face.reach - from.dot(i, face.out);
      const float rate = along.dot(i, face.out);
      const float t = room / rate;
      const bool inwards = rate < 0.0F && t > enters[i];
      const bool outwards = rate >= 0.0F && t < leaves[i];
      enters[i] = inwards ? t : enters[i];
      met[i] = inwards ? number : met[i];
      leaves[i] = outwards ? t : leaves[i];
      left[i] = outwards ? number : left[i];
    }
  }

  /// Once the rod's own faces are crossed: do its ends matter to any ray that may be within?
  [[nodiscard, gnu::always_inline]] bool ends_matter(float length_m) const {
    int any = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float place_m = from.z[i] + enters[i] * along.z[i];
      const int inside = enters[i] > ray.tnear[i] ? 0 : valid[i];
      const int low = place_m >= 0.0F ? inside : valid[i];
      const int beyond = place_m <= length_m ? low : valid[i];
      any |= enters[i] <= leaves[i] ? beyond : 0;
    }
    return any != 0;
  }

  /// Where a ray meets the limb; a ray from within meets it from behind.
  [[nodiscard]] bool from_outside(std::size_t i) const { return enters[i] > ray.tnear[i]; }
  [[nodiscard]] bool meets(std::size_t i) const {
    const float t = from_outside(i) ? enters[i] : leaves[i];
    return valid[i] != 0 && enters[i] <= leaves[i] && t > ray.tnear[i] && t < ray.tfar[i];
  }
  [[nodiscard]] Vector3f normal(std::size_t i, const Vector3f& out) const {
    return {out[0] * row_x.x[i] + out[1] * row_y.x[i] + out[2] * row_z.x[i],
            out[0] * row_x.y[i] + out[1] * row_y.y[i] + out[2] * row_z.y[i],
            out[0] * row_x.z[i] + out[1] * row_y.z[i] + out[2] * row_z.z[i]};
  }
};

void Limb::stop(std::uint32_t number, const Valid& valid, RTCRayHit16& packet) const {
  with_wide_vectors([&]() __attribute__((always_inline)) {
    Passage way{packet.ray, valid, begin_, change_};
    for (std::size_t face = 0; face < kSides; ++face) {
      way.cross_face(faces_[face], static_cast<int>(face));
    }
    const bool all = way.ends_matter(length_m_);
    for (std::size_t face = kSides; all && face < faces_.size(); ++face) {
      way.cross_face(faces_[face], static_cast<int>(face));
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      if (!way.meets(i)) {
        continue;
      }
      const bool outside = way.from_outside(i);
      const auto face = static_cast<std::size_t>(outside ? way.met[i] : way.left[i]);
      const Vector3f normal = way.normal(i, faces_[face].out);
      packet.ray.tfar[i] = outside ? way.enters[i] : way.leaves[i];
      packet.hit.geomID[i] = static_cast<unsigned>(HitKind::kPerson);
      packet.hit.primID[i] = number;
      packet.hit.Ng_x[i] = normal.x();
      packet.hit.Ng_y[i] = normal.y();
      packet.hit.Ng_z[i] = normal.z();
    }
  });
}

}  // namespace geoflow::simulator
