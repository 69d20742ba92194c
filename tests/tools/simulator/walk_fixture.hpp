#pragma once

#include <array>
#include <stdexcept>
#include <utility>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::simulator::tests {

/// A line with a bend, two sharp corners, and ends to turn round at.
inline std::array<Vector2d, 5> bent_line() {
  return {Vector2d{0, 0}, Vector2d{3, 0}, Vector2d{4.5, 0.8}, Vector2d{4.5, 3}, Vector2d{2, 4}};
}

inline Walk walk_of(const WalkOptions& options) {
  Result<Walk> planned = plan_walk(bent_line(), options);
  if (!planned) {
    throw std::runtime_error{planned.error().message};
  }
  return std::move(*planned);
}

/// A walk of `duration_s` with otherwise the options given.
inline Walk walk_for(double duration_s, WalkOptions options = {}) {
  options.duration_s = duration_s;
  return walk_of(options);
}

}  // namespace geoflow::simulator::tests
