#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/leg_simulator.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/walk.hpp"

#include "simulator/walk_fixture.hpp"

namespace geoflow::slam {

constexpr double kWalkS = 20;
constexpr double kFrameS = 1.0 / 30;

inline HostTime walk_time(double t_s) {
  return HostTime{from_seconds(t_s)};
}

/// A simulated Go2's walk: the samples of its sensors but the camera's, and the exact truth.
class SimulatedWalk {
 public:
  explicit SimulatedWalk(std::uint64_t seed, const simulator::ImuOptions& options = {})
      : walk_{simulator::tests::walk_for(kWalkS, {.seed = seed})} {
    const SE3 T_base_cam = simulator::go2_T_base_cam();
    calibration.T_base_cam = T_base_cam;
    calibration.T_cam_imu = simulator::d435i_T_cam_imu();
    calibration.imu_noise = options.noise;
    calibration.imu_noise.rate_hz = options.rate_hz;
    const SE3 T_base_imu = T_base_cam * simulator::d435i_T_cam_imu();
    for (const auto& r : simulator::ImuSimulator{walk_, T_base_imu, seed, options}.readings()) {
      imu.push_back({walk_time(r.t_s), {}, r.sample});
    }
    const simulator::LegSimulator simulated{walk_, seed, {}};
    for (std::size_t i = 0; i < simulated.size(); ++i) {
      const auto r = simulated.reading(i);
      legs.push_back({walk_time(r.t_s), {}, r.sample});
      const auto body = walk_.state(r.t_s).body;
      body_velocity.push_back(
          {walk_time(r.t_s),
           {},
           {.v_base_mps = body.T_world_base.rotation().inverse() * body.v_world_base,
            .w_base_radps = body.w_base}});
    }
  }

  [[nodiscard]] SE3 T_world_base(double t_s) const { return walk_.state(t_s).body.T_world_base; }
  [[nodiscard]] SE3 T_world_cam(double t_s) const {
    const SE3 T_base_cam = *calibration.T_base_cam;
    return T_world_base(t_s) * T_base_cam;
  }
  [[nodiscard]] Vector3d v_world_base(double t_s) const {
    return walk_.state(t_s).body.v_world_base;
  }

  /// The packet of the frame at t_s, without images: the samples since the frame before, and of
  /// each kind the next one behind.
  [[nodiscard]] SyncedPacket samples_until(double t_s) const {
    const HostTime after = walk_time(t_s - kFrameS);
    SyncedPacket packet;
    packet.t = walk_time(t_s);
    packet.imu = window(imu, after, packet.t);
    packet.legs = window(legs, after, packet.t);
    packet.body_velocity = window(body_velocity, after, packet.t);
    return packet;
  }

  Calibration calibration;
  std::vector<Timed<ImuSample>> imu;
  std::vector<Timed<LegSample>> legs;
  std::vector<Timed<BodyVelocitySample>> body_velocity;

 private:
  template <typename Sample>
  static std::vector<Timed<Sample>> window(const std::vector<Timed<Sample>>& all, HostTime after,
                                           HostTime until) {
    const auto t = &Timed<Sample>::t;
    const auto begin = std::ranges::upper_bound(all, after, {}, t);
    const auto end = std::ranges::lower_bound(begin, all.end(), until, {}, t);
    return {begin, end == all.end() ? end : std::next(end)};
  }

  simulator::Walk walk_;
};

}  // namespace geoflow::slam
