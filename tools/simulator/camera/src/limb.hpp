#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

namespace geoflow::simulator {

/// A capsule that moves, as rays meet it: a rod of ten sides with blunt ends, where the ray's time
/// has it on a straight way between its places at times 0 and 1. Const and thread-safe.
///
/// A ray is taken to the limb's own axes, in which it is the same whatever the time: what is on the
/// inner side of fifty planes. The ray is within from where it has crossed the last of them inwards
/// to where it crosses the first outwards (Kay and Kajiya, "Ray tracing complex scenes", 1986).
class Limb {
 public:
  /// Both of one length and with the same radii, which differ by less than 0.4 of the length.
  Limb(const Capsule& begin, const Capsule& end);

  /// What it stays within [m in world].
  [[nodiscard]] const Eigen::AlignedBox3f& within() const noexcept { return within_; }

  /// Ends those of the rays with valid[i] == -1 on it that meet it before where they end so far.
  void stop(std::uint32_t number, const std::array<int, kLanes>& valid, RTCRayHit16& packet) const;

 private:
  static constexpr std::size_t kSides = 10;
  static constexpr std::size_t kBands = 5;  ///< of sides: the rod's own, and two of either end's
  /// Its point (x, y, z) is at start + x * side + y * other + z * axis in world.
  struct Axes {
    Eigen::Vector3f start = Eigen::Vector3f::Zero();
    Eigen::Vector3f side = Eigen::Vector3f::UnitX();
    Eigen::Vector3f other = Eigen::Vector3f::UnitY();
    Eigen::Vector3f axis = Eigen::Vector3f::UnitZ();

    Axes() = default;
    Axes(const Capsule& capsule, const Eigen::Vector3f& away);
  };
  /// In those axes, out . p <= reach is its inner side.
  struct Face {
    Eigen::Vector3f out;
    float reach;
  };

  struct Passage;
  [[nodiscard]] static std::array<Face, kBands * kSides> faces_of(const Capsule& capsule);

  Axes begin_;
  Axes change_;  ///< from time 0 to time 1
  float length_m_;
  std::array<Face, kBands * kSides> faces_;  ///< band by band, the rod's own first
  Eigen::AlignedBox3f within_;
};

}  // namespace geoflow::simulator
