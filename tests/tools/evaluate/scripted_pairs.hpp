#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <random>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools::tests_evaluate {

/// A transform drawn at random: rotation vector and translation uniform in [-3, 3].
inline SE3 random_transform(std::mt19937_64& random) {
  std::uniform_real_distribution<double> any{-3, 3};
  Vector6d xi;
  for (double& x : xi) {
    x = any(random);
  }
  return SE3::exp(xi);
}

/// `count` references drawn at random, 0.1 s apart, with equal estimates.
inline PosePairs random_pairs(std::uint64_t seed, std::size_t count) {
  std::mt19937_64 random{seed};
  PosePairs pairs;
  for (std::size_t i = 0; i < count; ++i) {
    const SE3 pose = random_transform(random);
    pairs.push_back(
        {.t = HostTime{std::chrono::milliseconds{100 * i}}, .estimate = pose, .reference = pose});
  }
  return pairs;
}

/// A pair of positions without rotation at a time in seconds.
inline PosePair pair_at(double t_s, const Vector3d& estimate, const Vector3d& reference) {
  return {.t = HostTime{from_seconds(t_s)},
          .estimate = SE3{Eigen::Quaterniond::Identity(), estimate},
          .reference = SE3{Eigen::Quaterniond::Identity(), reference}};
}

}  // namespace geoflow::tools::tests_evaluate
