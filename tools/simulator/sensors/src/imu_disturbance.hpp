#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/walk.hpp"

#include "src/shock.hpp"

/// What disturbs an IMU on a walking robot.
namespace geoflow::simulator {

/// Each landing foot strikes the body, and the IMU's mount rings.
class TouchdownShocks {
 public:
  TouchdownShocks(const Walk& walk, std::uint64_t seed, const ImuOptions& options);

  /// What they add at `t_s`, in the imu frame. Times must not decrease from call to call.
  [[nodiscard]] ImuSample at(double t_s);

 private:
  struct Strike {
    Shock shock;
    Vector3d accel_mps2 = Vector3d::Zero();  ///< amplitudes by axis
    Vector3d gyro_radps = Vector3d::Zero();
  };
  std::vector<Strike> strikes_;  ///< in order of time
  std::size_t first_ = 0;        ///< strikes before it have rung out
};

/// Bursts in which the readings are distorted: strong vibration at several frequencies, rectified
/// into an offset, in both sensors.
class FaultBursts {
 public:
  FaultBursts(double duration_s, std::uint64_t seed, const ImuOptions& options);

  /// What a burst adds at `t_s`, in the imu frame; none outside bursts.
  [[nodiscard]] std::optional<ImuSample> at(double t_s) const;

 private:
  struct Vibration {
    double hz = 0;
    double phase_rad = 0;
    Vector3d accel_mps2 = Vector3d::Zero();
    Vector3d gyro_radps = Vector3d::Zero();
  };
  struct Burst {
    double start_s = 0;
    double end_s = 0;
    Vector3d accel_offset_mps2 = Vector3d::Zero();
    std::vector<Vibration> vibrations{};
  };
  static Burst burst(RandomStream random, double start_s, const ImuOptions& options);

  std::vector<Burst> bursts_;
};

}  // namespace geoflow::simulator
