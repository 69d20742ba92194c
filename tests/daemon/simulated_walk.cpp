#include "simulated_walk.hpp"

#include <filesystem>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "process.hpp"

namespace geoflow::tests {

std::filesystem::path simulate_walk(const std::filesystem::path& directory,
                                    const std::string& scene, int seed, int duration_s) {
  const auto bag = directory / "bag";
  const Finished simulated =
      run_process({GEOFLOW_PROGRAM, "simulate", scene, "-o", bag.string(), "--seed",
                   std::to_string(seed), "--duration", std::to_string(duration_s), "--set",
                   "camera.width=320", "--set", "camera.height=240"},
                  directory / "simulate");
  EXPECT_EQ(simulated.code, 0) << simulated.err;
  return simulated.code == 0 ? bag : std::filesystem::path{};
}

Trajectory read_poses(const std::filesystem::path& file) {
  auto read = tools::read_trajectory(file);
  EXPECT_TRUE(read) << read.error().message;
  return read ? std::move(read->poses) : Trajectory{};
}

StampedPose pose_at(const Trajectory& trajectory, double since_start_s) {
  const HostTime t = trajectory.front().t + from_seconds(since_start_s);
  const auto found = std::ranges::lower_bound(trajectory, t, {}, &StampedPose::t);
  return found == trajectory.end() ? trajectory.back() : *found;
}

SE3 motion_until(const Trajectory& trajectory, double since_start_s) {
  return trajectory.front().pose.inverse() * pose_at(trajectory, since_start_s).pose;
}

}  // namespace geoflow::tests
