#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <vector>

#include <embree3/rtcore.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/candidates.hpp"
#include "src/flat.hpp"

namespace geoflow::simulator {

inline constexpr std::size_t kPacket = kLanes;  ///< rays traced together
using RayPacket = RTCRayHit16;
using Valid = std::array<int, kPacket>;  ///< -1: this lane's ray counts; 0: it does not

/// What a ray hit, as Embree's geometry number.
enum class HitKind : unsigned { kPatch = 0, kCapsule = 1, kPerson = 2 };

/// The scene in the ray tracer. Tracing is const and thread-safe; moving the people is not.
class RayScene {
 public:
  [[nodiscard]] static Result<std::unique_ptr<RayScene>> create(const Scene& scene);

  /// From here on, rays see the people walk from where they are at begin_s to where they are at
  /// end_s.
  void move_people(double begin_s, double end_s);
  /// The ray time of a moment; 0 … 1 within what the people were moved to, and never beyond.
  [[nodiscard]] float ray_time(double t_s) const noexcept;
  /// How far any part of the people moves from begin_s to end_s, at most [m]; or during a part of
  /// it.
  [[nodiscard]] float people_travel_m() const noexcept { return people_travel_m_; }
  [[nodiscard]] float people_travel_m(double duration_s) const noexcept;

  /// Sets a packet's members that all rays share: no hit yet, time 0, from 1 mm on to infinity.
  static void reset(RayPacket& packet);
  /// The same but for the time.
  static void renew(RayPacket& packet);
  /// The first hits of the lanes with valid[i] == -1; hit.geomID stays RTC_INVALID_GEOMETRY_ID
  /// without one.
  void trace(const Valid& valid, RayPacket& packet) const;
  /// The same for rays that can meet nothing but `candidates`.
  void trace_among(const Candidates& candidates, const Valid& valid, RayPacket& packet) const;
  /// The same as trace() among the things that stand still.
  void trace_static(const Valid& valid, RayPacket& packet) const;
  /// Is there something that stands still between `from` and `to`, 2 mm from either?
  [[nodiscard]] bool blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const;

  /// The number of the patch, of the capsule or of the person's capsule that a lane hit.
  [[nodiscard]] static std::size_t primitive(const RayPacket& packet, std::size_t lane);

  [[nodiscard]] const Scene& scene() const noexcept { return *scene_; }
  /// A person's capsule at time 0 of the interval, by that number.
  [[nodiscard]] const Capsule& person_capsule(std::size_t primitive) const {
    return people_begin_[primitive];
  }

 private:
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
  };
  template <typename Handle>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

  explicit RayScene(const Scene& scene)
      : scene_{&scene}, flats_(scene.patches.begin(), scene.patches.end()) {}
  void add_patches();
  void add_capsules();
  void add_people();
  /// Lets those of the rays that come near a person end on them.
  void meet_people(const Valid& valid, RayPacket& packet) const;
  /// Traces what has met no patch yet: between two that touch, rounding may let a ray through.
  void trace_gaps(const Valid& valid, RayPacket& packet) const;
  [[nodiscard]] Valid near_people(const Valid& valid, const RayPacket& packet) const;

  const Scene* scene_;
  std::vector<Flat> flats_;  ///< of the patches
  Owned<RTCDevice> device_;
  Owned<RTCScene> standing_;
  Owned<RTCScene> walking_;  ///< the people; null if there are none
  Owned<RTCGeometry> people_;
  double people_begin_s_ = 0;
  double people_end_s_ = 0;
  float people_travel_m_ = 0;  ///< between the two
  /// What a person stays within while they are moved.
  struct Box {
    std::array<float, 3> low_m;
    std::array<float, 3> high_m;
  };
  std::vector<Capsule> people_begin_;
  std::vector<Box> people_boxes_;
  std::array<float*, 2> people_vertices_{};  ///< Embree's buffers for ray time 0 and 1
};

}  // namespace geoflow::simulator
