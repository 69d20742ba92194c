#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <vector>

#include <embree3/rtcore.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/scene.hpp"

namespace geoflow::simulator {

inline constexpr std::size_t kPacket = 16;  ///< rays traced together
using RayPacket = RTCRayHit16;

/// What a ray hit, as Embree's geometry number.
enum class HitKind : unsigned { kPatch = 0, kCapsule = 1, kPerson = 2 };

/// The scene in the ray tracer. Tracing is const and thread-safe; moving the people is not.
class RayScene {
 public:
  [[nodiscard]] static Result<std::unique_ptr<RayScene>> create(const Scene& scene);

  /// From here on, ray time 0 … 1 stands for begin_s … end_s in the people's walk.
  void move_people(double begin_s, double end_s);

  /// Sets a packet's members that all rays share: no hit yet, time 0, from 1 mm on to infinity.
  static void reset(RayPacket& packet);
  /// The first hits of the lanes with valid[i] == -1; hit.geomID stays RTC_INVALID_GEOMETRY_ID
  /// without one.
  void trace(const std::array<int, kPacket>& valid, RayPacket& packet) const;
  /// The same among the things that stand still.
  void trace_static(const std::array<int, kPacket>& valid, RayPacket& packet) const;
  /// Is there something that stands still between `from` and `to`, 2 mm from either?
  [[nodiscard]] bool blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const;

  /// The number of the patch, of the capsule or of the person's capsule that a lane hit.
  [[nodiscard]] static std::size_t primitive(const RayPacket& packet, std::size_t lane);

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

  explicit RayScene(const Scene& scene) : scene_{&scene} {}
  void attach(RTCGeometry geometry, HitKind kind, bool moves);
  void add_patches();
  void add_capsules();
  void add_people();

  const Scene* scene_;
  Owned<RTCDevice> device_;
  Owned<RTCScene> all_;
  Owned<RTCScene> standing_;  ///< without the people; null if there are none
  Owned<RTCGeometry> people_;
  std::vector<Capsule> people_begin_;
  std::array<float*, 2> people_vertices_{};  ///< Embree's buffers for ray time 0 and 1
};

}  // namespace geoflow::simulator
