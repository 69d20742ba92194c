#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

Config with_camera() {
  Config config;
  config.source.camera = "d435i";
  config.d435i.serial = "000000000000";  // no camera's
  return config;
}

TEST(DeviceCamera, OneThatIsNotThereIsSaidInWords) {
  for (const char* transport : {"v4l2", "libusb", "auto"}) {
    Config config = with_camera();
    config.d435i.transport = transport;
    const auto run = open_run(config);
    ASSERT_FALSE(run);
    EXPECT_THAT(run.error().message,
                HasSubstr("no D435i with the serial number 000000000000 is connected"))
        << transport;
  }
}

TEST(DeviceCamera, WhatCannotBeIsAnError) {
  Config config = with_camera();
  config.source.camera = "d455";
  EXPECT_THAT(open_run(config).error().message, HasSubstr("source.camera: 'd455' is no device"));
  config = with_camera();
  config.d435i.transport = "usb";
  EXPECT_THAT(open_run(config).error().message, HasSubstr("there are: auto, v4l2, libusb"));
  config = with_camera();
  config.source.realtime = false;
  EXPECT_THAT(open_run(config).error().message, HasSubstr("keeps its own pace"));
  config = with_camera();
  config.source.replay = "recording";
  EXPECT_THAT(open_run(config).error().message, HasSubstr("source.replay must be empty"));
}

}  // namespace
}  // namespace geoflow::daemon
