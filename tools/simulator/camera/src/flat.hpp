#pragma once

#include <array>
#include <cstdint>

#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/scene.hpp"

namespace geoflow::simulator {

/// A patch as rays meet it.
struct Flat {
  Eigen::Vector3f normal;
  Eigen::Vector3f axis_u;
  Eigen::Vector3f axis_v;
  float height_m;    ///< the plane is {x : normal . x = height_m}
  float origin_u_m;  ///< u of x is axis_u . x - origin_u_m
  float origin_v_m;
  std::array<Eigen::Vector3f, 4> edges;  ///< edge . (u, v, 1) >= 0 on the patch's side

  explicit Flat(const Patch& patch);

  /// Ends those of a packet's rays on it that meet it before where they end so far.
  void stop(std::uint32_t number, RTCRayHit16& packet) const;
};

}  // namespace geoflow::simulator
