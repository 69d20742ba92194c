#pragma once

#include <array>
#include <filesystem>
#include <string_view>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

/// Recordings of walking robots as the leg odometry sees them, with truth.
namespace geoflow::tests {

struct WalkRecording {
  std::vector<Timed<ImuSample>> imu;  ///< in base's axes
  std::vector<Timed<LegSample>> legs;
  std::vector<Timed<BodyVelocitySample>> twists;  ///< empty in all recordings read here
  std::vector<Timed<SE3>> truth;                  ///< T_world_base, z up, at the times of `legs`
  /// Who stands, as the recording says; empty where it does not.
  std::vector<std::array<bool, kLegCount>> contacts;

  /// The truth at the sample nearest to `t`.
  [[nodiscard]] SE3 truth_at(HostTime t) const;

  /// Length of base's path in [from, to], from points 0.1 s apart, so that motion capture's noise
  /// does not lengthen it [m].
  [[nodiscard]] double path_m(HostTime from, HostTime to) const;
};

/// The seconds since the recording's start as a time.
[[nodiscard]] HostTime at_seconds(double seconds);

/// The folder go1-legs: a real Go1, 25 s at 200 Hz, no forces and no torques; its first seconds it
/// lies still, then stands up. Joint rates of the first rows, which are an artefact of
/// differentiation, are set to zero.
[[nodiscard]] WalkRecording read_go1_walk(const std::filesystem::path& folder);

/// A file of the folder go2-trot: physics of a trotting Go2 at 500 Hz. It starts in the middle of a
/// drop from a few millimetres.
[[nodiscard]] WalkRecording read_go2_trot(const std::filesystem::path& file);

/// The pose `standing` of go2_real_standing_and_lying.csv: joints of a real Go2.
[[nodiscard]] LegSample read_go2_snapshot(const std::filesystem::path& file, std::string_view pose);

}  // namespace geoflow::tests
