#pragma once

#include <filesystem>
#include <string>

#include "geoflow/hal/trajectory.hpp"

namespace geoflow::tests {

/// Simulates a walk through a scene, in images of half the camera's size, as a bag in
/// `directory`/bag. A test failure, and an empty path, where that does not work.
std::filesystem::path simulate_walk(const std::filesystem::path& directory,
                                    const std::string& scene, int seed, int duration_s);

/// A trajectory in TUM's format; a test failure where it cannot be read.
Trajectory read_poses(const std::filesystem::path& file);

/// The first pose at or after so long after the trajectory's first [s]; its last after its end.
StampedPose pose_at(const Trajectory& trajectory, double since_start_s);

/// How the first pose's frame sees the pose at `since_start_s`: the same for two trajectories in
/// different frames.
SE3 motion_until(const Trajectory& trajectory, double since_start_s);

}  // namespace geoflow::tests
