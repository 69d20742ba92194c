#include <algorithm>
#include <filesystem>
#include <string>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "replay/fixtures.hpp"
#include "replay/openloris/calibration.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::at_ms;
using tests::drain;
using tests::message_of;
using tests::Recorder;

TEST(Factory, ListsWhatItLookedFor) {
  const TemporaryDirectory directory;
  tests::write_text(directory.path() / "readme.txt", "nothing here\n");
  EXPECT_THAT(
      message_of(RecordedStreams::open({.path = directory.path()})),
      AllOf(HasSubstr("not a recording of a known kind"), HasSubstr("rgb.txt and depth.txt"),
            HasSubstr("aligned_depth.txt"), HasSubstr("imu0/data.csv")));
  EXPECT_THAT(message_of(RecordedStreams::open({.path = directory.path() / "none"})),
              HasSubstr("no such recording"));
}

TEST(Euroc, ReadsAnImuAloneWithoutACalibration) {
  const TemporaryDirectory directory;
  tests::write_text(directory.path() / "mav0/imu0/data.csv",
                    "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\r\n"
                    "1000000,1,2,3,4,5,6\r\n"
                    "2000000,1,2,3,4,5,oops\r\n"
                    "3000000, 7, 8, 9, 10, 11, 12\r\n");
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_NE((*streams)->imu(), nullptr);
  ASSERT_TRUE((*streams)->imu()->start(recorder));
  EXPECT_THAT(drain(**streams),
              ElementsAre(AllOf(HasSubstr("data.csv:3"), HasSubstr("'oops' is not a number"))));
  ASSERT_EQ(recorder.imus.size(), 2U);
  EXPECT_EQ(recorder.imus[0].sample.gyro_radps, (Vector3d{1, 2, 3}));
  EXPECT_EQ(recorder.imus[0].sample.accel_mps2, (Vector3d{4, 5, 6}));
  EXPECT_EQ(recorder.imus[1].t_arrival, at_ms(3));
  EXPECT_EQ((*streams)->info().start, at_ms(1));
  EXPECT_EQ((*streams)->info().end, at_ms(3));
}

TEST(Euroc, ReadsARealRecording) {
  GEOFLOW_DATA_OR_SKIP(path, "euroc-v102");
  for (const auto& place : {path, path / "imu.csv"}) {
    auto streams = RecordedStreams::open({.path = place});
    ASSERT_TRUE(streams) << streams.error().message;
    Recorder recorder;
    ASSERT_TRUE((*streams)->imu()->start(recorder));
    EXPECT_THAT(drain(**streams), ElementsAre());
    EXPECT_EQ(recorder.imus.size(), (*streams)->info().streams.at(0).count);
    EXPECT_GT(recorder.imus.size(), 10000U);
    EXPECT_NEAR(recorder.imus.front().sample.accel_mps2.norm(), 9.81, 0.5);
  }
}

constexpr const char* kSensors =
    "%YAML:1.0\n---\n"
    "d400_color_optical_frame:\n   fps: 30\n   width: 32\n   height: 24\n   model: pinhole\n"
    "   distortion_model: radial-tangential\n"
    "   intrinsics: !!opencv-matrix\n      rows: 1\n      cols: 4\n      dt: d\n"
    "      data: [ 6.1145e+02, 15.5, 6.1148e+02,\n          11.5 ]\n"
    "   distortion_coefficients: !!opencv-matrix\n      rows: 1\n      cols: 5\n      dt: d\n"
    "      data: [ 0.1, 0., 0., 0., 0. ]\n"
    "d400_accelerometer:\n   fps: 250\n";

constexpr const char* kTransforms =
    "%YAML:1.0\n---\ntrans_matrix:\n"
    "   -\n      parent_frame: base_link\n      child_frame: laser\n      matrix: !!opencv-matrix\n"
    "         data: [ 1., 0., 0., 0.2, 0., 1., 0., 0., 0., 0., 1., 0.1, 0., 0., 0., 1. ]\n"
    "   -\n      parent_frame: laser\n      child_frame: d400_color_optical_frame\n      matrix: "
    "!!opencv-matrix\n"
    "         data: [ 0., 0., 1., 0.3, -1., 0., 0., 0., 0., -1., 0., 0.4, 0., 0., 0., 1. ]\n"
    "   -\n      parent_frame: d400_accelerometer\n      child_frame: d400_color_optical_frame\n"
    "      matrix: !!opencv-matrix\n"
    "         data: [ 1., 0., 0., 0.05, 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1. ]\n";

/// Three frames 0.1 s apart; gyroscope every 20 ms, accelerometer every 40 ms with x = the time in
/// seconds.
void write_openloris(const std::filesystem::path& directory) {
  std::string color = "#Time(s) path\n";
  std::string depth = color;
  std::string accel = "#Time x y z\n";
  std::string gyro = accel;
  for (int i = 0; i < 3; ++i) {
    color += fmt::format("{:.6f} color/{}.png\n", 10 + 0.1 * i, i);
    depth += fmt::format("{:.6f} aligned_depth/{}.png\n", 10 + 0.1 * i, i);
    tests::write_color(directory / fmt::format("color/{}.png", i), i);
    tests::write_depth(directory / fmt::format("aligned_depth/{}.png", i), 7);
  }
  for (int ms = 9990; ms <= 10250; ms += 20) {
    gyro += fmt::format("{:.3f} {} 0 0\n", 1e-3 * ms, ms);
  }
  for (int ms = 9985; ms <= 10225; ms += 40) {
    accel += fmt::format("{:.3f} {:.3f} 0 9.81\n", 1e-3 * ms, 1e-3 * ms);
  }
  tests::write_text(directory / "color.txt", color);
  tests::write_text(directory / "aligned_depth.txt", depth);
  tests::write_text(directory / "depth.txt", "not read\n");
  tests::write_text(directory / "d400_accelerometer.txt", accel);
  tests::write_text(directory / "d400_gyroscope.txt", gyro);
  tests::write_text(directory / "sensors.yaml", kSensors);
  tests::write_text(directory / "trans_matrix.yaml", kTransforms);
}

TEST(OpenLoris, MergesImagesAndAnInterpolatedImu) {
  const TemporaryDirectory directory;
  write_openloris(directory.path());
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  ASSERT_TRUE((*streams)->imu()->start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre());
  EXPECT_EQ(recorder.colors.size(), 3U);
  EXPECT_TRUE(std::ranges::is_sorted(recorder.arrivals));
  // The gyroscope's stamps from 9990 to 10210 ms; at 10230 and 10250 there is no acceleration any
  // more.
  ASSERT_EQ(recorder.imus.size(), 12U);
  for (const auto& imu : recorder.imus) {
    EXPECT_NEAR(imu.sample.accel_mps2.x(), to_seconds(imu.t_arrival.time_since_epoch()), 1e-6);
    EXPECT_NEAR(imu.sample.gyro_radps.x(), 1e3 * to_seconds(imu.t_arrival.time_since_epoch()),
                1e-6);
  }
  EXPECT_EQ((*streams)->info().start, at_ms(9990));
}

TEST(OpenLoris, FindsItsCalibration) {
  const TemporaryDirectory directory;
  write_openloris(directory.path());
  const auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  const Calibration& calibration = (*streams)->calibration();
  EXPECT_EQ(calibration.camera.fx, 611.45);
  EXPECT_EQ(calibration.camera.cx, 15.5);
  EXPECT_EQ(calibration.camera.fy, 611.48);
  EXPECT_EQ(calibration.camera.cy, 11.5);
  EXPECT_EQ(calibration.camera.model, DistortionModel::kRadtan);
  EXPECT_EQ(calibration.depth_unit_m, 1e-3);
  ASSERT_TRUE(calibration.T_base_cam && calibration.T_cam_imu);
  EXPECT_TRUE(calibration.T_base_cam->translation().isApprox(Vector3d{0.5, 0, 0.5}));
  EXPECT_TRUE((*calibration.T_base_cam * Vector3d::UnitZ()).isApprox(Vector3d{1.5, 0, 0.5}));
  EXPECT_TRUE(calibration.T_cam_imu->translation().isApprox(Vector3d{-0.05, 0, 0}));
}

TEST(OpenLoris, NamesLineAndKeyOfABadCalibration) {
  FoundCalibration found;
  std::string sensors = kSensors;
  sensors.replace(sensors.find("width: 32"), 9, "width: -1");
  EXPECT_THAT(message_of(openloris::parse_sensors("sensors.yaml", sensors)),
              HasSubstr("sensors.yaml:5: d400_color_optical_frame.width"));
  EXPECT_THAT(message_of(openloris::parse_sensors("sensors.yaml", "%YAML:1.0\na: 1\n")),
              HasSubstr("width, height and intrinsics are expected"));
  std::string transforms = kTransforms;
  transforms.replace(transforms.find("[ 1."), 4, "[ 2.");
  EXPECT_THAT(message_of(openloris::parse_transforms("trans_matrix.yaml", transforms, found)),
              AllOf(HasSubstr("trans_matrix.yaml:"), HasSubstr("is not a rotation")));
}

TEST(OpenLoris, LivesWithoutAnImuAndNamesBadLines) {
  const TemporaryDirectory directory;
  write_openloris(directory.path());
  tests::write_text(directory.path() / "d400_gyroscope.txt", "10.0 1 2 3\nbad line\n10.05 1 2 3\n");
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_THAT(drain(**streams), ElementsAre(HasSubstr("d400_gyroscope.txt:2")));
  std::filesystem::remove(directory.path() / "d400_gyroscope.txt");
  streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams);
  EXPECT_EQ((*streams)->imu(), nullptr);
}

}  // namespace
}  // namespace geoflow::drivers
