#include "geoflow/tools/estimate_table.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

class EstimateTableTest : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "estimates.csv"; }

  static std::vector<PoseEstimate> some() {
    std::vector<PoseEstimate> estimates(3);
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      PoseEstimate& estimate = estimates[i];
      estimate.t = HostTime{std::chrono::nanoseconds{1'305'031'102'160'407'001 + i}};
      const auto s = static_cast<double>(i);
      estimate.T_odom_base = SE3::exp((Vector6d{} << 0.1 * s, 2, -3, 4, 5.5 * s, 6).finished());
      Matrix6d root = Matrix6d::Random();
      estimate.covariance = root * root.transpose();
      estimate.status = i == 1 ? TrackingStatus::kDegraded : TrackingStatus::kTracking;
      estimate.source = i == 1 ? PoseSource::kConstantVelocity : PoseSource::kLegs;
      estimate.quality = static_cast<std::uint8_t>(90 + i);
      estimate.reset_counter = static_cast<std::uint32_t>(i);
      estimate.map_id = static_cast<std::uint32_t>(7 * i);
    }
    return estimates;
  }

  /// The file with one text in the place of another.
  void write_with(const std::string& from, const std::string& to) {
    ASSERT_TRUE(write_estimates(file(), some()));
    std::ifstream in{file()};
    std::string text{std::istreambuf_iterator<char>{in}, {}};
    text.replace(text.find(from), from.size(), to);
    std::ofstream{file()} << text;
  }

  void expect_refused(const std::string& message) {
    const auto read = read_estimates(file());
    ASSERT_FALSE(read);
    EXPECT_THAT(read.error().message, HasSubstr(message));
  }

  tests::TemporaryDirectory folder_;
};

TEST_F(EstimateTableTest, IsReadAsItWasWritten) {
  const auto written = some();
  ASSERT_TRUE(write_estimates(file(), written));
  const auto read = read_estimates(file());
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    EXPECT_EQ((*read)[i].t, written[i].t);
    EXPECT_EQ((*read)[i].status, written[i].status);
    EXPECT_EQ((*read)[i].source, written[i].source);
    EXPECT_EQ((*read)[i].quality, written[i].quality);
    EXPECT_EQ((*read)[i].reset_counter, written[i].reset_counter);
    EXPECT_EQ((*read)[i].map_id, written[i].map_id);
    EXPECT_LT(((*read)[i].T_odom_base.inverse() * written[i].T_odom_base).log().norm(), 1e-8);
    EXPECT_TRUE((*read)[i].covariance.isApprox(written[i].covariance, 1e-6));
  }
}

TEST_F(EstimateTableTest, IsATrajectoryInEurocsFormToo) {
  ASSERT_TRUE(write_estimates(file(), some()));
  const auto read = read_trajectory(file());
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->format, TrajectoryFormat::kEuroc);
  EXPECT_EQ(read->poses.size(), 3U);
}

TEST_F(EstimateTableTest, WhatIsWrongIsNamedWithItsLine) {
  write_with("DEGRADED", "HAPPY");
  expect_refused("estimates.csv:3: column 9: 'HAPPY' is no status");
  write_with("constant_velocity", "hearsay");
  expect_refused("estimates.csv:3: column 10: 'hearsay' is no source");
  write_with(",91,", ",-1,");
  expect_refused("estimates.csv:3: column 11: '-1' is no quality");
  write_with("1305031102160407003", "1305031102160407002");
  expect_refused("estimates.csv:4: the time does not come after the line before's");
  write_with("TRACKING,", "TRACKING,,");
  expect_refused("estimates.csv:2: expected the 34 columns of estimates.csv");
  write_with(",DEGRADED", ",0,DEGRADED");
  expect_refused("estimates.csv:3: expected the 34 columns");
}

TEST_F(EstimateTableTest, AFileWithoutEstimatesIsRefused) {
  std::ofstream{file()} << "#nothing\n";
  expect_refused("no estimate in it");
  std::filesystem::remove(file());
  expect_refused("No such file");
}

}  // namespace
}  // namespace geoflow::tools
