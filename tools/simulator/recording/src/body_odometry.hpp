#pragma once

#include <cstddef>
#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/recording_options.hpp"

namespace geoflow::simulator {

/// The robot's own odometry: its true twist with a scale error on each axis and white noise.
/// Deterministic by seed; const calls are thread-safe.
class BodyOdometry {
 public:
  BodyOdometry(std::uint64_t seed, const RecordingOptions& options);

  /// Sample `index`, of a body that moves like this.
  [[nodiscard]] BodyVelocitySample sample(std::size_t index, const BodyState& body) const;

 private:
  RandomStream noise_;
  Vector3d scale_;
  double noise_mps_;
  double gyro_noise_radps_;
};

}  // namespace geoflow::simulator
