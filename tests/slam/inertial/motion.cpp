#include "slam/inertial/motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"

namespace geoflow::slam::inertial_tests {
namespace {

Vector3d uniform3(std::mt19937_64& random, double scale) {
  std::uniform_real_distribution<double> uniform{-scale, scale};
  const double x = uniform(random);
  const double y = uniform(random);
  return {x, y, uniform(random)};
}

double seconds(HostTime t) {
  return to_seconds(t.time_since_epoch());
}

Vector3d row3(const std::vector<double>& row, std::size_t first) {
  return {row[first], row[first + 1], row[first + 2]};
}

HostTime at_ns(double ns) {
  return HostTime{Duration{static_cast<std::int64_t>(ns)}};
}

}  // namespace

SineMotion::SineMotion(std::mt19937_64& random) {
  constexpr std::array<double, kSines> kHertz{0.3, 1.1, 3.0};
  constexpr std::array<double, kSines> kMetres{0.6, 0.05, 0.01};
  constexpr std::array<double, kSines> kRadians{0.5, 0.1, 0.04};
  for (std::size_t i = 0; i < kSines; ++i) {
    const double rate = 2 * std::numbers::pi * kHertz[i];
    position_[i] = {uniform3(random, kMetres[i]), uniform3(random, std::numbers::pi), rate};
    rotation_[i] = {uniform3(random, kRadians[i]), uniform3(random, std::numbers::pi), rate};
  }
}

SineMotion::Value SineMotion::evaluate(const std::array<Sine, kSines>& sines, double t_s) {
  Value sum{Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()};
  for (const Sine& sine : sines) {
    const Eigen::Array3d angle = sine.phase.array() + sine.rate_radps * t_s;
    const Vector3d in_phase = (sine.amplitude.array() * angle.sin()).matrix();
    sum.value += in_phase;
    sum.first += sine.rate_radps * (sine.amplitude.array() * angle.cos()).matrix();
    sum.second -= sine.rate_radps * sine.rate_radps * in_phase;
  }
  return sum;
}

NavState SineMotion::state(HostTime t) const {
  const Value position = evaluate(position_, seconds(t));
  const Value rotation = evaluate(rotation_, seconds(t));
  return {SE3{so3::exp(rotation.value), position.value}, position.first, {}};
}

ImuSample SineMotion::measure(HostTime t) const {
  const Value position = evaluate(position_, seconds(t));
  const Value rotation = evaluate(rotation_, seconds(t));
  const Eigen::Quaterniond R_imu_odom = so3::exp(rotation.value).conjugate();
  return {.accel_mps2 = R_imu_odom * (position.second - gravity_down()),
          .gyro_radps = so3::right_jacobian(rotation.value) * rotation.first};
}

Vector3d normal3(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return {x, y, normal(random)};
}

std::vector<Timed<ImuSample>> perfect_samples(const SineMotion& motion, HostTime t_begin,
                                              HostTime t_end, double rate_hz) {
  std::vector<Timed<ImuSample>> samples;
  const double period_s = 1 / rate_hz;
  const auto count = static_cast<int>(std::ceil(to_seconds(t_end - t_begin) / period_s - 1e-9));
  for (int i = 0; i <= count; ++i) {
    const HostTime t = t_begin + from_seconds(i * period_s);
    samples.push_back({t, {}, motion.measure(t)});
  }
  return samples;
}

std::vector<Timed<ImuSample>> noisy_samples(const SineMotion& motion, HostTime t_begin,
                                            HostTime t_end, const ImuBias& bias,
                                            const ImuNoise& noise, std::mt19937_64& random) {
  std::vector<Timed<ImuSample>> samples = perfect_samples(motion, t_begin, t_end, noise.rate_hz);
  const double root = std::sqrt(noise.rate_hz);
  for (Timed<ImuSample>& timed : samples) {
    timed.sample.gyro_radps += bias.gyro_radps + root * noise.gyro_noise_density * normal3(random);
    timed.sample.accel_mps2 += bias.accel_mps2 + root * noise.accel_noise_density * normal3(random);
  }
  return samples;
}

std::vector<std::vector<double>> read_csv(const std::filesystem::path& path) {
  std::ifstream file{path};
  std::vector<std::vector<double>> rows;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream fields{line};
    std::vector<double> row;
    for (double value = 0; fields >> value;) {
      row.push_back(value);
    }
    rows.push_back(row);
  }
  return rows;
}

std::vector<Timed<ImuSample>> read_euroc_imu(const std::filesystem::path& folder) {
  std::vector<Timed<ImuSample>> samples;
  for (const auto& row : read_csv(folder / "imu.csv")) {
    samples.push_back(
        {at_ns(row.at(0)), {}, {.accel_mps2 = row3(row, 4), .gyro_radps = row3(row, 1)}});
  }
  return samples;
}

std::vector<TrueState> read_euroc_truth(const std::filesystem::path& folder) {
  std::vector<TrueState> states;
  for (const auto& row : read_csv(folder / "groundtruth.csv")) {
    const Eigen::Quaterniond R_odom_imu{row.at(4), row.at(5), row.at(6), row.at(7)};
    states.push_back(
        {at_ns(row[0]),
         {SE3{R_odom_imu, row3(row, 1)}, row3(row, 8), {row3(row, 11), row3(row, 14)}}});
  }
  return states;
}

std::vector<Timed<ImuSample>> read_go1_imu(const std::filesystem::path& folder) {
  const auto accel = read_csv(folder / "Accel_body_IMU.csv");
  const auto gyro = read_csv(folder / "Gyro_body_IMU.csv");
  std::vector<Timed<ImuSample>> samples;
  for (std::size_t i = 0; i < std::min(accel.size(), gyro.size()); ++i) {
    samples.push_back({HostTime{from_seconds(accel[i].at(0))},
                       {},
                       {.accel_mps2 = row3(accel[i], 1), .gyro_radps = row3(gyro[i], 1)}});
  }
  return samples;
}

ImuNoise euroc_noise() {
  return {.accel_noise_density = 8.0e-3,
          .accel_random_walk = 4.0e-5,
          .gyro_noise_density = 12.0e-4,
          .gyro_random_walk = 4.0e-6,
          .rate_hz = 200};
}

}  // namespace geoflow::slam::inertial_tests
