#include "geoflow/tools/simulator/imu_simulator.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/random_stream.hpp"
#include "geoflow/tools/simulator/support_forces.hpp"
#include "geoflow/tools/simulator/walk.hpp"

#include "src/imu_disturbance.hpp"

namespace geoflow::simulator {
namespace {

/// The D435i's reports before firmware 5.16: 0.001 g and 0.1 degrees a second.
constexpr double kAccelStepMps2 = 1e-3 * kGravityMps2;
constexpr double kGyroStepRadps = 0.1 * std::numbers::pi / 180;

/// A sensor triad's own errors: scale on the diagonal, misalignment beside it.
Matrix3d triad_errors(RandomStream random, const ImuOptions& options) {
  Matrix3d errors = Matrix3d::Identity();
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column) {
      const double size = row == column ? options.scale_error : options.misalignment_rad;
      errors(row, column) += size * random.normal();
    }
  }
  return errors;
}

Vector3d reported(const Vector3d& value, double range, double step, bool quantise) {
  Vector3d report = value.cwiseMin(range).cwiseMax(-range);
  if (quantise) {
    report = step * (report / step).array().round();
  }
  return report;
}

}  // namespace

ImuSample ideal_imu(const BodyState& body, const SE3& T_base_imu) {
  const Matrix3d R_base_world = body.T_world_base.rotation_matrix().transpose();
  const Matrix3d R_imu_base = T_base_imu.rotation_matrix().transpose();
  const Vector3d& arm = T_base_imu.translation();
  const Vector3d& w = body.w_base;
  const Vector3d accel_base =
      R_base_world * (body.a_world_base + kGravityMps2 * Vector3d::UnitZ()) +
      body.alpha_base.cross(arm) + w.cross(w.cross(arm));
  ImuSample sample;
  sample.accel_mps2 = R_imu_base * accel_base;
  sample.gyro_radps = R_imu_base * w;
  return sample;
}

ImuSimulator::ImuSimulator(const Walk& walk, const SE3& T_base_imu, std::uint64_t seed,
                           const ImuOptions& options)
    : walk_{walk}, T_base_imu_{T_base_imu}, seed_{seed}, options_{options} {}

std::vector<ImuReading> ImuSimulator::readings() const {
  const double period_s = 1 / options_.rate_hz;
  const double white = options_.noise_scale * std::sqrt(options_.rate_hz);
  const double walking = options_.noise_scale * std::sqrt(period_s);
  RandomStream accel_noise{seed_, "imu.accel_noise"};
  RandomStream gyro_noise{seed_, "imu.gyro_noise"};
  RandomStream accel_walk{seed_, "imu.accel_walk"};
  RandomStream gyro_walk{seed_, "imu.gyro_walk"};
  const Matrix3d accel_errors = triad_errors(RandomStream{seed_, "imu.accel_triad"}, options_);
  const Matrix3d gyro_errors = triad_errors(RandomStream{seed_, "imu.gyro_triad"}, options_);
  Vector3d accel_bias =
      options_.accel_bias_mps2 * RandomStream{seed_, "imu.accel_bias"}.normal_vector();
  Vector3d gyro_bias =
      options_.gyro_bias_radps * RandomStream{seed_, "imu.gyro_bias"}.normal_vector();
  TouchdownShocks shocks{walk_, seed_, options_};
  const FaultBursts faults{walk_.duration_s(), seed_, options_};

  const auto count =
      static_cast<std::size_t>(std::floor(walk_.duration_s() * options_.rate_hz)) + 1;
  std::vector<ImuReading> readings;
  readings.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    ImuReading reading;
    reading.t_s = static_cast<double>(i) / options_.rate_hz;
    ImuSample felt = ideal_imu(walk_.body().at(reading.t_s), T_base_imu_);
    const ImuSample shock = shocks.at(reading.t_s);
    felt.accel_mps2 += shock.accel_mps2;
    felt.gyro_radps += shock.gyro_radps;
    if (const std::optional<ImuSample> fault = faults.at(reading.t_s)) {
      felt.accel_mps2 += fault->accel_mps2;
      felt.gyro_radps += fault->gyro_radps;
      reading.faulty = true;
    }
    const Vector3d accel = accel_errors * felt.accel_mps2 + accel_bias +
                           white * options_.noise.accel_noise_density * accel_noise.normal_vector();
    const Vector3d gyro = gyro_errors * felt.gyro_radps + gyro_bias +
                          options_.gyro_per_accel * felt.accel_mps2 +
                          white * options_.noise.gyro_noise_density * gyro_noise.normal_vector();
    reading.sample.accel_mps2 =
        reported(accel, options_.accel_range_mps2, kAccelStepMps2, options_.quantise);
    reading.sample.gyro_radps =
        reported(gyro, options_.gyro_range_radps, kGyroStepRadps, options_.quantise);
    reading.accel_bias_mps2 = accel_bias;
    reading.gyro_bias_radps = gyro_bias;
    readings.push_back(reading);
    accel_bias += walking * options_.noise.accel_random_walk * accel_walk.normal_vector();
    gyro_bias += walking * options_.noise.gyro_random_walk * gyro_walk.normal_vector();
  }
  return readings;
}

}  // namespace geoflow::simulator
