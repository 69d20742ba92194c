#include "body_odometry.hpp"

#include <cstddef>
#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/recording_options.hpp"

namespace geoflow::simulator {

BodyOdometry::BodyOdometry(std::uint64_t seed, const RecordingOptions& options)
    : noise_{seed, "odometry.noise"},
      scale_{Vector3d::Ones() +
             options.odometry_scale_error * RandomStream{seed, "odometry.scale"}.normal_vector()},
      noise_mps_{options.odometry_noise_mps},
      gyro_noise_radps_{options.odometry_gyro_noise_radps} {}

BodyVelocitySample BodyOdometry::sample(std::size_t index, const BodyState& body) const {
  RandomStream own = noise_.at(index);
  const Vector3d v_base = body.T_world_base.rotation().conjugate() * body.v_world_base;
  const Vector3d noise_v = noise_mps_ * own.normal_vector();
  const Vector3d noise_w = gyro_noise_radps_ * own.normal_vector();
  return {.v_base_mps = scale_.cwiseProduct(v_base) + noise_v,
          .w_base_radps = body.w_base + noise_w};
}

}  // namespace geoflow::simulator
