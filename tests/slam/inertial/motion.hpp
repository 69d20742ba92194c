#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <random>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/nav_state.hpp"

/// Motions with known truth, and what a noisy IMU measures of them.
namespace geoflow::slam::inertial_tests {

/// Position and rotation vector as sums of three sines per axis, of a robot that trots: centimetres
/// and degrees at up to 3 Hz on top of a slow wander.
class SineMotion {
 public:
  explicit SineMotion(std::mt19937_64& random);

  /// Pose and velocity at t, biases zero.
  [[nodiscard]] NavState state(HostTime t) const;
  /// What a perfect IMU measures at t.
  [[nodiscard]] ImuSample measure(HostTime t) const;

 private:
  struct Sine {
    Vector3d amplitude;
    Vector3d phase;
    double rate_radps = 0;
  };
  struct Value {
    Vector3d value;
    Vector3d first;   ///< derivative by time
    Vector3d second;  ///< and again
  };
  static constexpr std::size_t kSines = 3;
  [[nodiscard]] static Value evaluate(const std::array<Sine, kSines>& sines, double t_s);

  std::array<Sine, kSines> position_;
  std::array<Sine, kSines> rotation_;
};

/// A standard normal 3-vector.
[[nodiscard]] Vector3d normal3(std::mt19937_64& random);

/// Samples at `noise.rate_hz` in [t_begin, t_end], with white noise and `bias`; no random walk.
[[nodiscard]] std::vector<Timed<ImuSample>> noisy_samples(const SineMotion& motion,
                                                          HostTime t_begin, HostTime t_end,
                                                          const ImuBias& bias,
                                                          const ImuNoise& noise,
                                                          std::mt19937_64& random);
/// Without noise, at `rate_hz`.
[[nodiscard]] std::vector<Timed<ImuSample>> perfect_samples(const SineMotion& motion,
                                                            HostTime t_begin, HostTime t_end,
                                                            double rate_hz);

/// The numbers of a csv file with one line of heads.
[[nodiscard]] std::vector<std::vector<double>> read_csv(const std::filesystem::path& path);

/// EuRoC's imu.csv and ground truth (T_odom_imu, v, biases), and a Go1's body IMU.
[[nodiscard]] std::vector<Timed<ImuSample>> read_euroc_imu(const std::filesystem::path& folder);
struct TrueState {
  HostTime t;
  NavState state;
};
[[nodiscard]] std::vector<TrueState> read_euroc_truth(const std::filesystem::path& folder);
[[nodiscard]] std::vector<Timed<ImuSample>> read_go1_imu(const std::filesystem::path& folder);

/// The noise of EuRoC's ADIS16448 in flight as its authors set it in OKVIS
/// (config_fpga_p2_euroc.yaml). The densities in the recording's sensor.yaml, 4 and 7 times
/// smaller, are Allan deviations at rest.
[[nodiscard]] ImuNoise euroc_noise();

}  // namespace geoflow::slam::inertial_tests
