#include "src/flat.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/ray_scene.hpp"

namespace geoflow::simulator {

using Eigen::Vector2f;
using Eigen::Vector3f;

Flat::Flat(const Patch& patch)
    : normal{patch.normal()},
      axis_u{patch.axis_u},
      axis_v{patch.axis_v},
      height_m{normal.dot(patch.origin)},
      origin_u_m{axis_u.dot(patch.origin)},
      origin_v_m{axis_v.dot(patch.origin)} {
  const auto on_patch = [&](std::size_t corner) {
    const Vector3f& at = patch.corners[corner % patch.corners.size()];
    return Vector2f{axis_u.dot(at) - origin_u_m, axis_v.dot(at) - origin_v_m};
  };
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const Vector2f from = on_patch(i);
    const Vector2f along = on_patch(i + 1) - from;
    edges[i] = {-along.y(), along.x(), along.y() * from.x() - along.x() * from.y()};
  }
}

void Flat::stop(std::uint32_t number, RTCRayHit16& packet) const {
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // Copies, because what lies behind a reference might change with every ray that is written.
    const Flat flat = *this;
    const RTCRay16 ray = packet.ray;
    std::array<std::uint32_t, kPacket> meets;
    Lanes end;
    for (std::size_t i = 0; i < kPacket; ++i) {
      const auto onto = [&](const Vector3f& axis, bool origin) __attribute__((always_inline)) {
        return origin ? axis[0] * ray.org_x[i] + axis[1] * ray.org_y[i] + axis[2] * ray.org_z[i]
                      : axis[0] * ray.dir_x[i] + axis[1] * ray.dir_y[i] + axis[2] * ray.dir_z[i];
      };
      const float t = (flat.height_m - onto(flat.normal, true)) / onto(flat.normal, false);
      const float u = onto(flat.axis_u, true) - flat.origin_u_m + t * onto(flat.axis_u, false);
      const float v = onto(flat.axis_v, true) - flat.origin_v_m + t * onto(flat.axis_v, false);
      const auto beside = [&](const Vector3f& edge) __attribute__((always_inline)) {
        return edge[0] * u + edge[1] * v + edge[2];
      };
      const float inside = std::min(std::min(beside(flat.edges[0]), beside(flat.edges[1])),
                                    std::min(beside(flat.edges[2]), beside(flat.edges[3])));
      const bool first = inside >= 0.0F && t > ray.tnear[i] && t < ray.tfar[i];
      meets[i] = first ? 1U : 0U;
      end[i] = t;
    }
    for (std::size_t i = 0; i < kPacket; ++i) {
      const bool here = meets[i] != 0;
      packet.ray.tfar[i] = here ? end[i] : ray.tfar[i];
      packet.hit.geomID[i] = here ? static_cast<unsigned>(HitKind::kPatch) : packet.hit.geomID[i];
      packet.hit.primID[i] = here ? number : packet.hit.primID[i];
    }
  });
}

}  // namespace geoflow::simulator
