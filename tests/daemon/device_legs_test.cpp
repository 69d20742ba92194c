
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

class DeviceLegs : public testing::Test {
 protected:
  void SetUp() override {
    tests::write_synthetic_recording(directory_.path(), {.frames = 2});
    config_.source.replay = directory_.path();
    config_.can.interfaces = "nocan7";
  }
  tests::TemporaryDirectory directory_;
  Config config_;
};

TEST_F(DeviceLegs, StandInForTheRecordings) {
  auto without = open_run(config_);
  ASSERT_TRUE(without) << without.error().message;
  EXPECT_EQ(without->ports().legs, nullptr);
  config_.source.legs = "can";
  auto run = open_run(config_);
  ASSERT_TRUE(run) << run.error().message;
  ASSERT_NE(run->ports().legs, nullptr);
  EXPECT_EQ(run->ports().legs, run->legs.get());
  EXPECT_EQ(run->legs->stamps().domain, StampDomain::kDevice);
  EXPECT_EQ(run->legs->health().state, SourceState::kStopped);
}

TEST_F(DeviceLegs, MayComeFromARobotOnDds) {
  config_.source.legs = "dds";
  config_.dds.interface = "nonet7";
  auto run = open_run(config_);
  if (!run && run.error().code == ErrorCode::kUnsupported) {
    GTEST_SKIP() << run.error().message;
  }
  ASSERT_TRUE(run) << run.error().message;
  ASSERT_NE(run->ports().legs, nullptr);
  EXPECT_EQ(run->ports().legs->stamps().domain, StampDomain::kDevice);
  EXPECT_EQ(run->imu, nullptr);  // the recording's stays
  EXPECT_EQ(run->ports().imu, run->streams->imu());
}

TEST_F(DeviceLegs, WhatCannotBeIsAnError) {
  config_.source.legs = "cam";
  EXPECT_THAT(open_run(config_).error().message, HasSubstr("source.legs: 'cam' is no device"));
  config_.source.legs.clear();
  config_.source.imu = "can";
  EXPECT_THAT(open_run(config_).error().message, HasSubstr("source.imu: 'can' is no device"));
  config_.source.imu = "dds";  // this recording does not say where the camera is on a robot
  EXPECT_THAT(open_run(config_).error().message, HasSubstr("T_base_cam"));
  config_.source.imu.clear();
  config_.source.legs = "can";
  config_.source.realtime = false;
  EXPECT_THAT(open_run(config_).error().message, HasSubstr("source.realtime must be true"));
  config_.source.realtime = true;
  config_.can.dictionary = "/nonexistent.dbc";
  EXPECT_EQ(open_run(config_).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace geoflow::daemon
