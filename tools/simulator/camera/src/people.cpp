#include "src/people.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/ray_scene.hpp"

namespace geoflow::simulator {
namespace {

/// Part of a ray, by its parameter.
struct Stretch {
  float enters;
  float leaves;
};

/// Between two planes across one axis: of a ray from there, with one over its way along it.
[[gnu::always_inline]] inline Stretch between(float from, float inverse, float low, float high) {
  const float to_low = (low - from) * inverse;
  const float to_high = (high - from) * inverse;
  return {.enters = std::min(to_low, to_high), .leaves = std::max(to_low, to_high)};
}

/// What both have; `b` counts for nothing where it is not a number.
[[gnu::always_inline]] inline Stretch common(const Stretch& a, const Stretch& b) {
  return {.enters = std::max(a.enters, b.enters), .leaves = std::min(a.leaves, b.leaves)};
}

/// A packet's rays, ready to be compared with boxes.
struct Beam {
  Lanes x;
  Lanes y;
  Lanes z;
  Lanes inverse_x;
  Lanes inverse_y;
  Lanes inverse_z;
  Lanes begin;
  Lanes end;
  Valid valid;

  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): the loop sets them
  [[gnu::always_inline]] Beam(const Valid& lanes, const RTCRay16& ray) : valid{lanes} {
    for (std::size_t i = 0; i < kLanes; ++i) {
      x[i] = ray.org_x[i];
      y[i] = ray.org_y[i];
      z[i] = ray.org_z[i];
      inverse_x[i] = 1.0F / ray.dir_x[i];
      inverse_y[i] = 1.0F / ray.dir_y[i];
      inverse_z[i] = 1.0F / ray.dir_z[i];
      begin[i] = ray.tnear[i];
      end[i] = ray.tfar[i];
    }
  }
  /// Is any of them in a box on its way?
  [[nodiscard, gnu::always_inline]] bool crosses(const Eigen::AlignedBox3f& box) const {
    const Eigen::Vector3f& low = box.min();
    const Eigen::Vector3f& high = box.max();
    int any = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
      Stretch met{.enters = begin[i], .leaves = end[i]};
      met = common(met, between(x[i], inverse_x[i], low[0], high[0]));
      met = common(met, between(y[i], inverse_y[i], low[1], high[1]));
      met = common(met, between(z[i], inverse_z[i], low[2], high[2]));
      any |= met.enters <= met.leaves ? valid[i] : 0;
    }
    return any != 0;
  }
};

}  // namespace

People::People(const Scene& scene) : scene_{&scene} {
  move(0, 0);
}

void People::move(double begin_s, double end_s) {
  begin_s_ = begin_s;
  end_s_ = end_s;
  travel_m_ = 0;
  capsules_.clear();
  limbs_.clear();
  bodies_.clear();
  for (const Pedestrian& person : scene_->pedestrians) {
    const auto begin = person.body(begin_s);
    const auto end = person.body(end_s);
    Eigen::AlignedBox3f body;
    for (std::size_t i = 0; i < begin.size(); ++i) {
      capsules_.push_back(begin[i]);
      body.extend(limbs_.emplace_back(begin[i], end[i]).within());
      travel_m_ = std::max(
          {travel_m_, (end[i].start - begin[i].start).norm(), (end[i].end - begin[i].end).norm()});
    }
    bodies_.push_back(body);
  }
}

float People::ray_time(double t_s) const noexcept {
  const double span_s = end_s_ - begin_s_;
  return span_s > 0 ? static_cast<float>(std::clamp((t_s - begin_s_) / span_s, 0.0, 1.0)) : 0.0F;
}

float People::travel_m(double duration_s) const noexcept {
  const double span_s = end_s_ - begin_s_;
  return span_s > 0 ? travel_m_ * static_cast<float>(duration_s / span_s) : 0.0F;
}

void People::stop(const Valid& valid, RTCRayHit16& packet) const {
  if (bodies_.empty()) {
    return;
  }
  with_wide_vectors([&]() __attribute__((always_inline)) {
    const Beam beam{valid, packet.ray};
    bool near = false;  // the person whose limb it is
    for (std::size_t limb = 0; limb < limbs_.size(); ++limb) {
      if (limb % Pedestrian::kCapsules == 0) {
        near = beam.crosses(bodies_[limb / Pedestrian::kCapsules]);
      }
      if (near && beam.crosses(limbs_[limb].within())) {
        limbs_[limb].stop(static_cast<std::uint32_t>(limb), valid, packet);
      }
    }
  });
}

}  // namespace geoflow::simulator
