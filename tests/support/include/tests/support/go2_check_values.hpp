#pragma once

#include <array>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow::tests {

/// Forward kinematics of Unitree's Go2 model, computed by MuJoCo.
struct CheckValue {
  Leg leg;
  Vector3d q;     ///< hip, thigh, calf [rad]
  Vector3d foot;  ///< the foot frame's origin in base [m]
};

// NOLINTBEGIN(modernize-use-std-numbers): coordinates, one of which is near 1 / pi
inline std::array<CheckValue, 7> go2_check_values() {
  return {{{.leg = Leg::kFrontRight,
            .q = {0, 0.9, -1.8},
            .foot = {0.193400000, -0.142000000, -0.264805846}},
           {.leg = Leg::kFrontLeft,
            .q = {-0.1, 0.8, -1.5},
            .foot = {0.177821520, 0.110443765, -0.319288753}},
           {.leg = Leg::kRearRight,
            .q = {0.5, -0.4, -0.9},
            .foot = {0.094784000, -0.008936211, -0.267956786}},
           {.leg = Leg::kRearLeft,
            .q = {-0.6, 2.0, -2.6},
            .foot = {-0.266811505, 0.076106889, -0.125857306}},
           {.leg = Leg::kFrontRight,
            .q = {-0.7, 0, -1.0},
            .foot = {0.372633320, -0.330900197, -0.189409994}},
           {.leg = Leg::kFrontRight,
            .q = {0.35, 1.2, -2.2},
            .foot = {0.174108994, -0.070282301, -0.213356732}},
           {.leg = Leg::kRearLeft,
            .q = {0.3, 0.5, -2.0},
            .foot = {-0.083051208, 0.197427385, -0.164748253}}}};
}
// NOLINTEND(modernize-use-std-numbers)

}  // namespace geoflow::tests
