#include "geoflow/hal/calibration.hpp"

#include <array>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <random>
#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "replay/calibration/find.hpp"
#include "replay/calibration/kalibr.hpp"
#include "replay/fixtures.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::message_of;

constexpr std::string_view kGood = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  intrinsics: [600.5, 601.5, 320.25, 240.75]
  distortion_model: radtan
  distortion_coeffs: [0.1, -0.2, 0.001, -0.002]
  resolution: [640, 480]
  rostopic: /camera/color/image_raw
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.01]
  - [0.0, 0.0, -1.0, 0.02]
  - [1.0, 0.0, 0.0, 0.03]
  - [0.0, 0.0, 0.0, 1.0]
  timeshift_cam_imu: -0.0035
cam1: {camera_model: omni}
depth_factor: 5000
serial: '0123'
)";

TEST(Kalibr, ReadsACameraChain) {
  const auto read = kalibr::parse_camchain("camchain.yaml", std::string{kGood});
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera.width, 640);
  EXPECT_EQ(read->camera.fx, 600.5);
  EXPECT_EQ(read->camera.fy, 601.5);
  EXPECT_EQ(read->camera.cx, 320.25);
  EXPECT_EQ(read->camera.cy, 240.75);
  EXPECT_EQ(read->camera.model, DistortionModel::kRadtan);
  EXPECT_THAT(read->camera.distortion, ElementsAre(0.1, -0.2, 0.001, -0.002, 0));
  EXPECT_EQ(read->timeshift_cam_imu, std::chrono::microseconds{-3500});
  EXPECT_DOUBLE_EQ(read->depth_unit_m, 0.0002);
  EXPECT_EQ(read->serial, "0123");
  ASSERT_TRUE(read->T_cam_imu);
  // The IMU's x axis (1, 0, 0) is the camera's z axis: rows are read as rows.
  EXPECT_TRUE((*read->T_cam_imu * Vector3d::UnitX()).isApprox(Vector3d{0.01, 0.02, 1.03}));
  EXPECT_FALSE(read->T_base_cam);
}

struct BadEdit {
  std::string_view from;
  std::string_view to;
  std::string_view where;  ///< file, line and key
  std::string_view what;
};

class KalibrError : public testing::TestWithParam<BadEdit> {};

TEST_P(KalibrError, NamesFileLineAndKey) {
  std::string content{kGood};
  const auto at = content.find(GetParam().from);
  ASSERT_NE(at, std::string::npos);
  content.replace(at, GetParam().from.size(), GetParam().to);
  EXPECT_THAT(
      message_of(kalibr::parse_camchain("chain.yaml", content)),
      AllOf(HasSubstr(std::string{GetParam().where}), HasSubstr(std::string{GetParam().what})));
}

INSTANTIATE_TEST_SUITE_P(
    Edits, KalibrError,
    testing::Values(
        BadEdit{"pinhole", "eucm", "chain.yaml:3: cam0.camera_model", "'eucm' is not supported"},
        BadEdit{"600.5, 601.5, ", "", "chain.yaml:4: cam0.intrinsics",
                "2 numbers where 4 are expected"},
        BadEdit{"600.5", "many", "chain.yaml:4: cam0.intrinsics", "'many' is not a number"},
        BadEdit{"600.5", "-600", "chain.yaml:4: cam0.intrinsics", "must be positive"},
        BadEdit{"600.5", ".nan", "chain.yaml:4: cam0.intrinsics", "'.nan' is not a number"},
        BadEdit{"radtan", "fov", "chain.yaml:5: cam0.distortion_model",
                "none of radtan, equidistant, none"},
        BadEdit{"radtan", "none", "chain.yaml:2: cam0", "without a distortion_model"},
        BadEdit{"[0.1, -0.2, 0.001, -0.002]", "[0.1]", "chain.yaml:6: cam0.distortion_coeffs",
                "1 numbers where 0 or 4 or 5"},
        BadEdit{"[640, 480]", "[640, 0]", "chain.yaml:7: cam0.resolution", "whole numbers"},
        BadEdit{"[640, 480]", "640x480", "chain.yaml:7: cam0.resolution", "a list of numbers"},
        BadEdit{"[0.0, -1.0, 0.0, 0.01]", "[0.0, -1.1, 0.0, 0.01]", "cam0.T_cam_imu",
                "is not a rotation"},
        BadEdit{"[0.0, -1.0, 0.0, 0.01]", "[0.0, 1.0, 0.0, 0.01]", "cam0.T_cam_imu",
                "is not a rotation"},
        BadEdit{"[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.1, 1.0]", "cam0.T_cam_imu", "last row"},
        BadEdit{"  - [0.0, 0.0, -1.0, 0.02]\n", "", "cam0.T_cam_imu", "four rows of four"},
        BadEdit{"-0.0035", "99999", "chain.yaml:14: cam0.timeshift_cam_imu", "plausible"},
        BadEdit{"timeshift_cam_imu", "timeshft_cam_imu", "chain.yaml:14: cam0.timeshft_cam_imu",
                "unknown key"},
        BadEdit{"depth_factor: 5000", "depth_factor: 0", "chain.yaml:16: depth_factor",
                "not positive"},
        BadEdit{"serial: '0123'", "depth_alignment: nearby", "chain.yaml:17: depth_alignment",
                "nearest_touching"},
        BadEdit{"depth_factor", "depth_scale", "chain.yaml:16: depth_scale", "unknown key"},
        BadEdit{"serial: '0123'", "depth_factor: 1", "chain.yaml:17: depth_factor", "stands twice"},
        BadEdit{"cam0:", "cam2:", "chain.yaml:1", "cam0 is missing"},
        BadEdit{"  resolution: [640, 480]\n", "", "chain.yaml:2: cam0", "resolution is missing"},
        BadEdit{"[600.5", "[[600.5", "chain.yaml:", "not YAML"}));

TEST(Kalibr, RefusesWhatIsNoMap) {
  for (const char* content :
       {"", "- 1\n", "just words\n", "cam0: 3\n", "cam0:\n", "? [a]\n: b\n", "\t"}) {
    EXPECT_FALSE(kalibr::parse_camchain("c", content)) << content;
  }
}

TEST(Kalibr, ReadsNoiseAtTheTopAndUnderImu0) {
  const auto top = kalibr::parse_imu(
      "imu.yaml", "accelerometer_noise_density: 0.02\nupdate_rate: 400\nrostopic: /imu\n");
  const auto nested =
      kalibr::parse_imu("imu.yaml", "imu0:\n  gyroscope_random_walk: 0.5\n  model: calibrated\n");
  ASSERT_TRUE(top && nested);
  EXPECT_EQ(top->accel_noise_density, 0.02);
  EXPECT_EQ(top->rate_hz, 400);
  EXPECT_EQ(nested->gyro_random_walk, 0.5);
  EXPECT_EQ(nested->accel_noise_density, ImuNoise{}.accel_noise_density);
  EXPECT_THAT(message_of(kalibr::parse_imu("imu.yaml", "\nupdate_rate: fast\n")),
              HasSubstr("imu.yaml:2: update_rate"));
  EXPECT_THAT(message_of(kalibr::parse_imu("imu.yaml", "rate: 1\n")),
              HasSubstr("imu.yaml:1: rate: an unknown key"));
}

Calibration random_calibration(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit{-1, 1};
  const auto pose = [&] {
    Vector6d xi;
    for (double& value : xi) {
      value = unit(random);
    }
    return SE3::exp(xi);
  };
  Calibration calibration;
  calibration.camera = {
      .width = 848,
      .height = 480,
      .fx = 600 + unit(random),
      .fy = 600 + unit(random),
      .cx = 424 + unit(random),
      .cy = 240 + unit(random),
      .model = DistortionModel::kRadtan,
      .distortion = {unit(random), unit(random), unit(random), unit(random), unit(random)}};
  calibration.depth_unit_m = 1e-3 * (2 + unit(random));
  calibration.depth_alignment = DepthAlignment::kNearestTouching;
  calibration.T_cam_imu = pose();
  calibration.T_base_cam = pose();
  calibration.timeshift_cam_imu = from_seconds(0.1 * unit(random));
  calibration.imu_noise = {.accel_noise_density = 2 + unit(random),
                           .accel_random_walk = 2 + unit(random),
                           .gyro_noise_density = 2 + unit(random),
                           .gyro_random_walk = 2 + unit(random),
                           .rate_hz = 200 + unit(random)};
  calibration.serial = "836612070000";
  return calibration;
}

void expect_same(const Calibration& a, const Calibration& b) {
  constexpr double kRounding = 1e-14;
  EXPECT_EQ(a.camera.width, b.camera.width);
  EXPECT_EQ(a.camera.height, b.camera.height);
  EXPECT_EQ(a.camera.fx, b.camera.fx);
  EXPECT_EQ(a.camera.fy, b.camera.fy);
  EXPECT_EQ(a.camera.cx, b.camera.cx);
  EXPECT_EQ(a.camera.cy, b.camera.cy);
  EXPECT_EQ(a.camera.model, b.camera.model);
  EXPECT_EQ(a.camera.distortion, b.camera.distortion);
  EXPECT_DOUBLE_EQ(a.depth_unit_m, b.depth_unit_m);
  EXPECT_EQ(a.depth_alignment, b.depth_alignment);
  EXPECT_EQ(a.timeshift_cam_imu, b.timeshift_cam_imu);
  EXPECT_EQ(a.serial, b.serial);
  EXPECT_EQ(a.imu_noise.accel_noise_density, b.imu_noise.accel_noise_density);
  EXPECT_EQ(a.imu_noise.gyro_random_walk, b.imu_noise.gyro_random_walk);
  EXPECT_EQ(a.imu_noise.rate_hz, b.imu_noise.rate_hz);
  ASSERT_EQ(a.T_cam_imu.has_value(), b.T_cam_imu.has_value());
  ASSERT_EQ(a.T_base_cam.has_value(), b.T_base_cam.has_value());
  if (a.T_cam_imu && a.T_base_cam) {
    EXPECT_LT((a.T_cam_imu->inverse() * *b.T_cam_imu).log().norm(), kRounding);
    EXPECT_LT((a.T_base_cam->inverse() * *b.T_base_cam).log().norm(), kRounding);
  }
}

TEST(CalibrationFile, ComesBackAsItWasSaved) {
  const auto seed = geoflow::tests::test_seed(1);
  std::mt19937_64 random{seed};
  for (int round = 0; round < 100; ++round) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " round " + std::to_string(round));
    const TemporaryDirectory directory;
    const Calibration calibration = random_calibration(random);
    ASSERT_TRUE(save_calibration(calibration, directory.path()));
    const auto loaded = load_calibration(directory.path());
    ASSERT_TRUE(loaded) << loaded.error().message;
    expect_same(calibration, *loaded);
  }
}

TEST(CalibrationFile, OtherModelsComeBackToo) {
  const TemporaryDirectory directory;
  Calibration calibration;
  calibration.camera = {.width = 8, .height = 4, .fx = 1, .fy = 2, .cx = 3, .cy = 4};
  ASSERT_TRUE(save_calibration(calibration, directory.path()));
  expect_same(calibration, *load_calibration(directory.path()));
  calibration.camera.model = DistortionModel::kEquidistant;
  ASSERT_TRUE(save_calibration(calibration, directory.path()));
  expect_same(calibration, *load_calibration(directory.path()));
}

TEST(CalibrationFile, LeavesNothingBehindWhereItCannotWrite) {
  const TemporaryDirectory directory;
  const auto missing = directory.path() / "missing";
  EXPECT_THAT(message_of(save_calibration({}, missing)), HasSubstr(missing.string()));
  std::filesystem::create_directories(directory.path() / "camchain-imucam.yaml/in_the_way");
  EXPECT_FALSE(save_calibration({}, directory.path()));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator{directory.path()}, {}), 1);
}

TEST(CalibrationFile, SaysWhatIsMissing) {
  const TemporaryDirectory directory;
  EXPECT_FALSE(has_calibration(directory.path()));
  EXPECT_THAT(message_of(load_calibration(directory.path())),
              HasSubstr("neither camchain-imucam.yaml nor camchain.yaml"));
}

TEST(PublishedCalibration, IsFoundByTheFoldersName) {
  const auto fr1 = published_calibration("rgbd_dataset_freiburg1_desk");
  const auto fr3 = published_calibration("fr3_office");
  ASSERT_TRUE(fr1 && fr3);
  EXPECT_EQ(fr1->camera.fx, 517.306408);
  EXPECT_EQ(fr1->camera.distortion.back(), 1.163314);
  EXPECT_DOUBLE_EQ(fr1->depth_unit_m, 0.0002);
  EXPECT_EQ(fr3->camera.model, DistortionModel::kNone);
  EXPECT_EQ(published_calibration("tum-fr2")->camera.fx, 520.908620);
  for (const char* name : {"fr4", "fr12", "afr1", "desk", "freiburg", ""}) {
    EXPECT_FALSE(published_calibration(name)) << name;
  }
}

TEST(FindCalibration, SaysWhatToProvide) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 1);
  std::filesystem::remove(directory.path() / "camchain.yaml");
  const auto streams = RecordedStreams::open({.path = directory.path()});
  EXPECT_THAT(message_of(streams),
              AllOf(HasSubstr("no camera calibration"), HasSubstr("--calibration DIR"),
                    HasSubstr("intrinsics: [525.0")));
}

TEST(FindCalibration, TakesTheOneAskedForFirst) {
  const TemporaryDirectory directory;
  const TemporaryDirectory other;
  tests::write_tum(directory.path(), 1);
  Calibration calibration;
  calibration.camera = {
      .width = tests::kWidth, .height = tests::kHeight, .fx = 77, .fy = 77, .cx = 1, .cy = 1};
  ASSERT_TRUE(save_calibration(calibration, other.path()));
  const auto streams =
      RecordedStreams::open({.path = directory.path(), .calibration = other.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ((*streams)->calibration().camera.fx, 77);
  EXPECT_FALSE(
      RecordedStreams::open({.path = directory.path(), .calibration = other.path() / "none"}));
}

TEST(FindCalibration, UsesPublishedCamerasOfTum) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "rgbd_dataset_freiburg2_xyz";
  tests::write_tum(path, 1);
  std::filesystem::remove(path / "camchain.yaml");
  const auto streams = RecordedStreams::open({.path = path / ""});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ((*streams)->calibration().camera.fx, 520.908620);
}

}  // namespace
}  // namespace geoflow::drivers
