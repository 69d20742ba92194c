#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <utility>
#include <vector>

#include "geoflow/tools/simulator/scene.hpp"

// A body's proportions, as fractions of its height, follow Drillis and Contini, "Body segment
// parameters", 1966; the swing of limbs is a sine of the amplitude seen in level walking.
// NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kStridePerHeight = 0.83F;  // two steps
constexpr float kThighSwing_rad = 0.42F;
constexpr float kKneeSwing_rad = 0.55F;
constexpr float kArmSwing_rad = 0.45F;

/// A body's own axes in world.
struct Axes {
  Vector3f origin;
  Vector3f forward;
  Vector3f left;
  float height_m;

  /// A point at fractions of the height.
  [[nodiscard]] Vector3f at(float x, float y, float z) const {
    return origin + height_m * (x * forward + y * left + z * Vector3f::UnitZ());
  }
};

/// Two segments that hang from `x, y, z` and swing about it: upper and lower.
std::array<Capsule, 2> limb(const Axes& axes, const Vector3f& root, std::array<float, 2> angles_rad,
                            std::array<float, 2> lengths) {
  const Vector3f middle =
      root + Vector3f{std::sin(angles_rad[0]), 0, -std::cos(angles_rad[0])} * lengths[0];
  const Vector3f tip =
      middle + Vector3f{std::sin(angles_rad[1]), 0, -std::cos(angles_rad[1])} * lengths[1];
  const auto world = [&](const Vector3f& p) { return axes.at(p.x(), p.y(), p.z()); };
  return {Capsule{.start = world(root), .end = world(middle)},
          Capsule{.start = world(middle), .end = world(tip)}};
}

void set_radii(Capsule& capsule, float start_m, float end_m, int material) {
  capsule.start_radius_m = start_m;
  capsule.end_radius_m = end_m;
  capsule.material = material;
}

}  // namespace

Pedestrian::Pedestrian(Walk walk) : walk_{std::move(walk)}, lengths_{0} {
  for (std::size_t i = 1; i < walk_.waypoints.size(); ++i) {
    lengths_.push_back(lengths_.back() + (walk_.waypoints[i] - walk_.waypoints[i - 1]).norm());
  }
}

Pedestrian::Place Pedestrian::place(double t_s) const {
  const float total = lengths_.back();
  const double walked =
      static_cast<double>(walk_.start_m) + static_cast<double>(walk_.speed_mps) * t_s;
  const double rounds = walked / (2.0 * static_cast<double>(total));
  const auto phase =
      static_cast<float>((rounds - std::floor(rounds)) * 2.0 * static_cast<double>(total));
  const bool back = phase > total;
  const float along = back ? 2.0F * total - phase : phase;
  const auto after =
      std::upper_bound(std::next(lengths_.begin()), std::prev(lengths_.end()), along);
  const auto i = static_cast<std::size_t>(after - lengths_.begin());
  const Vector2f leg = walk_.waypoints[i] - walk_.waypoints[i - 1];
  const float ratio = (along - lengths_[i - 1]) / (lengths_[i] - lengths_[i - 1]);
  return {.position = walk_.waypoints[i - 1] + ratio * leg,
          .heading = (back ? -1.0F : 1.0F) * leg.normalized(),
          .distance_m = static_cast<float>(
              std::fmod(walked, static_cast<double>(walk_.height_m * kStridePerHeight)))};
}

Vector2f Pedestrian::position(double t_s) const {
  return place(t_s).position;
}

std::array<Capsule, Pedestrian::kCapsules> Pedestrian::body(double t_s) const {
  const Place here = place(t_s);
  const float h = walk_.height_m;
  const float phase = 2.0F * std::numbers::pi_v<float> * here.distance_m / (h * kStridePerHeight);
  const Axes axes{
      .origin = {here.position.x(), here.position.y(), 0.01F * h * std::cos(2.0F * phase)},
      .forward = {here.heading.x(), here.heading.y(), 0},
      .left = {-here.heading.y(), here.heading.x(), 0},
      .height_m = h};
  const auto [skin, top, trousers, shoes] = walk_.materials;
  std::array<Capsule, kCapsules> body;
  std::size_t next = 0;
  for (const float side : {1.0F, -1.0F}) {
    const float swing = side * std::sin(phase);
    const float bend = kKneeSwing_rad * std::max(0.0F, side * std::cos(phase));
    auto leg = limb(axes, {0, 0.055F * side, 0.50F},
                    {kThighSwing_rad * swing, kThighSwing_rad * swing - bend}, {0.245F, 0.225F});
    set_radii(leg[0], 0.052F * h, 0.036F * h, trousers);
    set_radii(leg[1], 0.035F * h, 0.026F * h, trousers);
    Capsule foot{.start = leg[1].end, .end = leg[1].end + h * (0.09F * axes.forward)};
    set_radii(foot, 0.024F * h, 0.018F * h, shoes);
    auto arm = limb(axes, {0, 0.115F * side, 0.80F},
                    {-kArmSwing_rad * swing, 0.25F - kArmSwing_rad * swing}, {0.175F, 0.19F});
    set_radii(arm[0], 0.03F * h, 0.024F * h, top);
    set_radii(arm[1], 0.023F * h, 0.019F * h, skin);
    Capsule flank{.start = axes.at(0, 0.045F * side, 0.54F),
                  .end = axes.at(0, 0.05F * side, 0.76F)};
    set_radii(flank, 0.06F * h, 0.068F * h, top);
    for (const Capsule& part : {leg[0], leg[1], foot, arm[0], arm[1], flank}) {
      body[next++] = part;
    }
  }
  Capsule& head = body[next];
  head = {.start = axes.at(0.01F, 0, 0.915F), .end = axes.at(0.015F, 0, 0.945F)};
  set_radii(head, 0.05F * h, 0.055F * h, skin);
  return body;
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
