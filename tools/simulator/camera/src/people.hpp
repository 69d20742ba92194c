#pragma once

#include <array>
#include <vector>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/limb.hpp"

namespace geoflow::simulator {

/// A scene's people as rays meet them. Moving them is for one thread; all else is const and
/// thread-safe.
class People {
 public:
  /// The scene must outlive it.
  explicit People(const Scene& scene);

  /// From here on, rays see them walk from where they are at begin_s to where they are at end_s.
  void move(double begin_s, double end_s);
  /// The ray time of a moment; 0 … 1 within what they were moved to, and never beyond.
  [[nodiscard]] float ray_time(double t_s) const noexcept;
  /// How far any part of them moves from begin_s to end_s, at most [m]; or during a part of it.
  [[nodiscard]] float travel_m() const noexcept { return travel_m_; }
  [[nodiscard]] float travel_m(double duration_s) const noexcept;

  /// All limbs at time 0 of the interval, Pedestrian::kCapsules of each; a hit's primID counts
  /// them.
  [[nodiscard]] const std::vector<Capsule>& limbs() const noexcept { return capsules_; }

  /// Ends those of the rays with valid[i] == -1 on them that meet one before where they end so far.
  void stop(const std::array<int, kLanes>& valid, RTCRayHit16& packet) const;

 private:
  const Scene* scene_;
  double begin_s_ = 0;
  double end_s_ = 0;
  float travel_m_ = 0;
  std::vector<Capsule> capsules_;
  std::vector<Limb> limbs_;
  std::vector<Eigen::AlignedBox3f> bodies_;  ///< what each person stays within
};

}  // namespace geoflow::simulator
