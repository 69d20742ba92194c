#include "pipeline/camera_calibration.hpp"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

Calibration of(const std::string& serial, int width) {
  Calibration calibration;
  calibration.camera = {.width = width, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240};
  calibration.serial = serial;
  return calibration;
}

class CameraCalibration : public testing::Test {
 protected:
  /// What comes of `camera` with a file of a robot's for `serial`.
  [[nodiscard]] Result<Calibration> complete(const std::string& serial, Calibration camera,
                                             bool with_intrinsics = false) const {
    Calibration robot = of(serial, 640);
    robot.camera.fx = 601;
    robot.T_base_cam = SE3{Eigen::Quaterniond::Identity(), Vector3d{0.3, 0, 0.1}};
    EXPECT_TRUE(drivers::save_calibration(robot, directory_.path()));
    return complete_calibration(directory_.path(), with_intrinsics, camera).map([&] {
      return camera;
    });
  }

  tests::TemporaryDirectory directory_;
};

TEST_F(CameraCalibration, SaysWhereTheCameraSitsAndLeavesItsOwnIntrinsicsAlone) {
  const auto calibration = complete("0123", of("0123", 640));
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_EQ(calibration->T_base_cam->translation(), (Vector3d{0.3, 0, 0.1}));
  EXPECT_EQ(calibration->camera.fx, 600);
  EXPECT_THAT(calibration->source, HasSubstr("camchain-imucam.yaml"));
}

TEST_F(CameraCalibration, OfAnotherSerialNumberIsRefusedWithBothAndTheFile) {
  const auto refused = complete("0123", of("4567", 640));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message,
              HasSubstr((directory_.path() / "camchain-imucam.yaml").string()));
  EXPECT_THAT(refused.error().message, HasSubstr("serial number 0123; this one has 4567"));
}

TEST_F(CameraCalibration, WithoutASerialNumberOnOneSideIsTaken) {
  EXPECT_TRUE(complete("", of("4567", 640)));
  EXPECT_TRUE(complete("0123", of("", 640)));
}

TEST_F(CameraCalibration, OfAnotherSizeIsRefusedWhereItsIntrinsicsAreWanted) {
  EXPECT_TRUE(complete("", of("", 848)));
  const auto refused = complete("", of("", 848), true);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("is of a camera of 640x480; this one is 848x480"));
  EXPECT_EQ(complete("", of("", 640), true)->camera.fx, 601);
}

}  // namespace
}  // namespace geoflow::daemon
