#include "view/finished_run.hpp"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

class FinishedRunTest : public testing::Test {
 protected:
  /// Three frames 0.1 s apart along x, turned by a quarter about z; the second has no live pose.
  void write_run() const {
    std::vector<PoseEstimate> estimates;
    Trajectory live;
    for (int i = 0; i < 3; ++i) {
      PoseEstimate estimate;
      estimate.t = HostTime{std::chrono::seconds{7} + std::chrono::milliseconds{100} * i};
      estimate.T_odom_base =
          SE3{Eigen::Quaterniond{Eigen::AngleAxisd{std::acos(0.0), Vector3d::UnitZ()}},
              Vector3d{0.5 * i, 0, 0}};
      estimate.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 0.04, 0.01, 0.09;
      estimate.status = i == 2 ? TrackingStatus::kDegraded : TrackingStatus::kTracking;
      estimate.source = PoseSource::kLegs;
      estimate.quality = 80;
      estimates.push_back(estimate);
      if (i != 1) {
        live.push_back({estimate.t, estimate.T_odom_base});
      }
    }
    ASSERT_TRUE(write_estimates(path() / "estimates.csv", estimates));
    ASSERT_TRUE(write_tum(path() / "live_base.txt", live));
    ASSERT_TRUE(write_tum(path() / "final_base.txt", live));
  }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }
  [[nodiscard]] std::string error() const {
    const auto run = read_finished_run(path());
    return run ? std::string{} : run.error().message;
  }
  tests::TemporaryDirectory folder_;
};

TEST_F(FinishedRunTest, HasEachFrameThatHasALivePose) {
  write_run();
  const auto run = read_finished_run(path());
  ASSERT_TRUE(run) << run.error().message;
  const nlohmann::json& frames = run->at("frames");
  ASSERT_EQ(frames.size(), 2U);
  const nlohmann::json& last = frames.at(1);
  EXPECT_NEAR(last.at("t_s").get<double>(), 0.2, 1e-9);
  EXPECT_EQ(last.at("status"), "DEGRADED");
  EXPECT_EQ(last.at("source"), "legs");
  EXPECT_EQ(last.at("quality"), 80);
  EXPECT_NEAR(last.at("pose").at(0).get<double>(), 1, 1e-6);
  EXPECT_NEAR(last.at("pose").at(5).get<double>(), std::sqrt(0.5), 1e-6);
  // A quarter turn: the base's x is the map's y.
  const auto covariance = last.at("covariance").get<std::vector<double>>();
  EXPECT_NEAR(covariance[0], 0.01, 1e-9);
  EXPECT_NEAR(covariance[3], 0.04, 1e-9);
  EXPECT_NEAR(covariance[5], 0.09, 1e-9);
  EXPECT_EQ(run->at("final").size(), 2U);
}

TEST_F(FinishedRunTest, WhatIsMissingOrDamagedIsNamed) {
  EXPECT_THAT(error(), HasSubstr("estimates.csv"));
  write_run();
  std::filesystem::remove(path() / "final_base.txt");
  EXPECT_THAT(error(), HasSubstr("final_base.txt"));
  write_run();
  ASSERT_TRUE(write_tum(path() / "live_base.txt", {{HostTime{std::chrono::seconds{1}}, SE3{}}}));
  EXPECT_THAT(error(), HasSubstr("live_base.txt has no pose at the times of estimates.csv"));
}

}  // namespace
}  // namespace geoflow::tools
