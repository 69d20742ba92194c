#include <cstddef>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"

/// A walk of which ten seconds are blind.
namespace geoflow::daemon {
namespace {

using tests::run_process;

constexpr double kCoveredS = 4;
constexpr double kUncoveredS = 14;

Trajectory read(const std::filesystem::path& path) {
  auto file = tools::read_trajectory(path);
  EXPECT_TRUE(file) << file.error().message;
  return file ? std::move(file->poses) : Trajectory{};
}

/// The first pose at or after so long after the recording's first.
StampedPose at(const Trajectory& trajectory, double since_start_s) {
  const HostTime t = trajectory.front().t + from_seconds(since_start_s);
  const auto found = std::ranges::lower_bound(trajectory, t, {}, &StampedPose::t);
  return found == trajectory.end() ? trajectory.back() : *found;
}

double way_m(const Trajectory& trajectory, double from_s, double until_s) {
  const HostTime t_begin = at(trajectory, from_s).t;
  const HostTime t_end = at(trajectory, until_s).t;
  double way_m = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    if (trajectory[i - 1].t >= t_begin && trajectory[i].t <= t_end) {
      way_m += (trajectory[i].pose.translation() - trajectory[i - 1].pose.translation()).norm();
    }
  }
  return way_m;
}

TEST(CoveredLens, TenBlindSecondsOfWalkingAreBridgedByImuAndLegsAndSaid) {
  const tests::TemporaryDirectory directory;
  const auto bag = directory.path() / "bag";
  const auto out = directory.path() / "out";
  const auto script = directory.path() / "faults.toml";
  std::ofstream{script} << "[[fault]]\nkind = 'cover'\nstream = 'camera'\nfrom_s = " << kCoveredS
                        << "\nuntil_s = " << kUncoveredS << "\n";
  const auto simulated =
      run_process({GEOFLOW_PROGRAM, "simulate", "office", "-o", bag.string(), "--seed", "3",
                   "--duration", "16", "--set", "camera.width=320", "--set", "camera.height=240"},
                  directory.path() / "simulate");
  ASSERT_EQ(simulated.code, 0) << simulated.err;
  const auto replayed = run_process(
      {GEOFLOW_PROGRAM, "replay", bag.string(), "-o", out.string(), "--faults", script.string()},
      directory.path() / "replay");
  ASSERT_EQ(replayed.code, 0) << replayed.err;

  // It says so while it is blind, and sees its way again within a second.
  std::ifstream report_file{out / "report.json"};
  const auto report = nlohmann::json::parse(report_file);
  constexpr unsigned kBlindFrames = 300;
  constexpr unsigned kFramesASecond = 30;
  EXPECT_GE(report["by_status"]["DEGRADED"].get<unsigned>(), kBlindFrames);
  EXPECT_LE(report["by_status"]["DEGRADED"].get<unsigned>(), kBlindFrames + kFramesASecond);
  EXPECT_EQ(report["by_status"]["TRACKING"].get<unsigned>() +
                report["by_status"]["DEGRADED"].get<unsigned>(),
            report["frames"].get<unsigned>());

  const Trajectory live = read(out / "live_base.txt");
  const Trajectory truth = read(bag / "groundtruth_base.txt");
  ASSERT_FALSE(live.empty());
  ASSERT_FALSE(truth.empty());
  // From where both stood at first.
  const auto error = [&](double since_start_s) -> Vector3d {
    const auto moved = [&](const Trajectory& trajectory) {
      return (trajectory.front().pose.inverse() * at(trajectory, since_start_s).pose).translation();
    };
    return moved(live) - moved(truth);
  };
  const double blind_way_m = way_m(truth, kCoveredS, kUncoveredS);
  const double drift_m = (error(kUncoveredS) - error(kCoveredS)).norm();
  RecordProperty("blind_way_m", std::to_string(blind_way_m));
  RecordProperty("drift_m", std::to_string(drift_m));
  EXPECT_GT(blind_way_m, 3);
  // A degree of heading or tilt: what is known of them when the lens is covered, and what the
  // shocks of ten seconds of trot leave of a gyroscope's turn.
  EXPECT_LT(drift_m, std::numbers::pi / 180 * blind_way_m);
}

}  // namespace
}  // namespace geoflow::daemon
