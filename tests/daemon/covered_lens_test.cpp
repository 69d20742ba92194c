#include <cstddef>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "simulated_walk.hpp"

/// A walk of which ten seconds are blind.
namespace geoflow::daemon {
namespace {

using tests::motion_until;
using tests::pose_at;
using tests::read_poses;
using tests::run_process;
using tests::simulate_walk;

/// The lens is covered, or nothing comes from the camera at all.
class BlindWalk : public ::testing::TestWithParam<const char*> {};

constexpr double kCoveredS = 4;
constexpr double kUncoveredS = 14;

double way_m(const Trajectory& trajectory, double from_s, double until_s) {
  const HostTime t_begin = pose_at(trajectory, from_s).t;
  const HostTime t_end = pose_at(trajectory, until_s).t;
  double way_m = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    if (trajectory[i - 1].t >= t_begin && trajectory[i].t <= t_end) {
      way_m += (trajectory[i].pose.translation() - trajectory[i - 1].pose.translation()).norm();
    }
  }
  return way_m;
}

TEST_P(BlindWalk, TenSecondsAreBridgedByImuAndLegsAndSaid) {
  const tests::TemporaryDirectory directory;
  const auto bag = simulate_walk(directory.path(), "office", 3, 16);
  ASSERT_FALSE(bag.empty());
  const auto out = directory.path() / "out";
  const auto script = directory.path() / "faults.toml";
  std::ofstream{script} << "[[fault]]\nkind = '" << GetParam()
                        << "'\nstream = 'camera'\nfrom_s = " << kCoveredS
                        << "\nuntil_s = " << kUncoveredS << "\n";
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

  const Trajectory live = read_poses(out / "live_base.txt");
  const Trajectory truth = read_poses(bag / "groundtruth_base.txt");
  ASSERT_FALSE(live.empty());
  ASSERT_FALSE(truth.empty());
  // From where both stood at first.
  const auto error = [&](double since_start_s) -> Vector3d {
    return motion_until(live, since_start_s).translation() -
           motion_until(truth, since_start_s).translation();
  };
  const double blind_way_m = way_m(truth, kCoveredS, kUncoveredS);
  const double drift_m = (error(kUncoveredS) - error(kCoveredS)).norm();
  RecordProperty("blind_way_m", std::to_string(blind_way_m));
  RecordProperty("drift_m", std::to_string(drift_m));
  EXPECT_GT(blind_way_m, 3);
  EXPECT_LT(drift_m, 0.01 * blind_way_m);
}

INSTANTIATE_TEST_SUITE_P(Faults, BlindWalk, ::testing::Values("cover", "gap"),
                         [](const auto& fault) { return std::string{fault.param}; });

}  // namespace
}  // namespace geoflow::daemon
