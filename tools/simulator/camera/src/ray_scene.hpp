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
#include "src/people.hpp"

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

  /// Whom rays meet besides what stands still; moving them is for the thread that no ray is traced
  /// in meanwhile.
  [[nodiscard]] People& people() noexcept { return people_; }
  [[nodiscard]] const People& people() const noexcept { return people_; }

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

 private:
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
  };
  template <typename Handle>
  using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

  explicit RayScene(const Scene& scene)
      : scene_{&scene}, flats_(scene.patches.begin(), scene.patches.end()), people_{scene} {}
  void add_patches();
  void add_capsules();
  void add_people();
  /// Traces what has met no patch yet: between two that touch, rounding may let a ray through.
  void trace_gaps(const Valid& valid, RayPacket& packet) const;

  const Scene* scene_;
  std::vector<Flat> flats_;  ///< of the patches
  Owned<RTCDevice> device_;
  Owned<RTCScene> standing_;
  People people_;
};

}  // namespace geoflow::simulator
