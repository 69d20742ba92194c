#include "geoflow/tools/emulator/d435i.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include <gtest/gtest.h>
#include <zlib.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "device_fixture.hpp"
#include "scripted_world.hpp"

namespace geoflow::emulator {
namespace {

constexpr Duration kMillisecond{1'000'000};
constexpr Duration kFrame{33'333'333};
constexpr std::uint32_t k30Fps = 333333;
constexpr std::size_t kPixels = 640U * 480U;

float real(std::span<const std::byte> bytes, std::size_t offset) {
  return std::bit_cast<float>(field<std::uint32_t>(bytes, offset));
}

struct D435iTest : DeviceTest {
  void add_frames(int count) {
    for (int i = 0; i < count; ++i) {
      world->add_images(static_cast<std::uint8_t>(i), i * kFrame);
    }
  }
};

TEST_F(D435iTest, NegotiatesByABlockOf48Bytes) {
  plug();
  EXPECT_EQ(get(0xa1, 0x85, 0x0100, 1, 2), bytes_of({48, 0}));
  // 640 x 480 of depth is frame 5; 31 frames a second there are not.
  const Bytes wanted = ByteWriter{}.u16(1).u8(1).u8(5).u32(322580).pad_to(48).take();
  ASSERT_TRUE(set(0x21, 1, 0x0100, 1, wanted));
  const Bytes got = get(0xa1, 0x81, 0x0100, 1, 48).value_or(Bytes{});
  ASSERT_EQ(got.size(), 48U);
  EXPECT_EQ(field<std::uint8_t>(got, 3), 5);
  EXPECT_EQ(field<std::uint32_t>(got, 4), k30Fps);
  EXPECT_EQ(field<std::uint32_t>(got, 18), 2 * kPixels);
  EXPECT_GE(field<std::uint32_t>(got, 22), 2 * kPixels + 255);
  EXPECT_EQ(field<std::uint32_t>(got, 26), 48'000'000U);
  EXPECT_FALSE(set(0x21, 1, 0x0100, 1, bytes_of({1, 0, 1})));
}

TEST_F(D435iTest, SendsDepthAsItIsBehindAHeaderOf232Bytes) {
  add_frames(10);
  plug({.clock_start_us = 5'000'000});
  ASSERT_TRUE(commit(1, 1, 5, k30Fps));
  const HostTime start = now;
  const auto payloads = fetch(0x82, Duration{400'000'000});
  ASSERT_EQ(payloads.size(), 10U);
  for (std::size_t i = 0; i < payloads.size(); ++i) {
    const Bytes& payload = payloads[i];
    ASSERT_EQ(payload.size(), 232 + 2 * kPixels);
    EXPECT_EQ(field<std::uint8_t>(payload, 0), 232);
    EXPECT_EQ(field<std::uint8_t>(payload, 1), i % 2 == 0 ? 0x8e : 0x8f);
    EXPECT_EQ(field<std::uint32_t>(payload, 12), 0x80000001U);
    EXPECT_EQ(field<std::uint32_t>(payload, 16), 40U);
    EXPECT_EQ(field<std::uint32_t>(payload, 28), i + 1) << "frame counter";
    EXPECT_EQ(field<std::uint32_t>(payload, 52), 3U);
    EXPECT_EQ(field<std::uint32_t>(payload, 132), 0x80000000U);
    EXPECT_EQ(field<std::uint32_t>(payload, 192), 0x80000002U);
    EXPECT_EQ(field<std::uint16_t>(payload, 192 + 24), 640);
    EXPECT_EQ(field<std::uint16_t>(payload, 192 + 26), 480);
    EXPECT_EQ(field<std::uint16_t>(payload, 192 + 28), 30);
    // The stamp less its distance to the exposure is when the world showed it.
    const auto exposed = field<std::uint32_t>(payload, 2) - field<std::uint32_t>(payload, 32);
    EXPECT_NEAR(exposed, 5e6 + static_cast<double>(i) * 1e6 / 30.0, 1.0);
    EXPECT_TRUE(std::ranges::equal(std::span{payload}.subspan(232),
                                   ScriptedWorld::pixels(static_cast<std::uint8_t>(i), 2)));
  }
  EXPECT_GT(now, start);
  EXPECT_EQ(camera->counters().frames_sent, 10U);
  EXPECT_EQ(camera->counters().frames_dropped, 0U);
}

TEST_F(D435iTest, SendsColorAsYuyvBehindAHeaderOf244Bytes) {
  add_frames(1);
  plug();
  ASSERT_TRUE(commit(4, 1, 5, k30Fps));
  const auto payloads = fetch(0x84, Duration{50'000'000});
  ASSERT_EQ(payloads.size(), 1U);
  const Bytes& payload = payloads[0];
  ASSERT_EQ(payload.size(), 244 + 2 * kPixels);
  EXPECT_EQ(field<std::uint8_t>(payload, 0), 244);
  EXPECT_EQ(field<std::uint32_t>(payload, 132), 0x80000005U);
  EXPECT_EQ(field<std::uint32_t>(payload, 204), 0x80000002U);
  // BT.601 in floating point.
  for (std::size_t i = 0; i < kPixels; i += 977) {
    const auto at = [&](std::size_t channel) {
      return static_cast<double>(ScriptedWorld::pattern(0, 3 * i + channel));
    };
    const double luma = 16 + (65.481 * at(2) + 128.553 * at(1) + 24.966 * at(0)) / 255.0;
    EXPECT_NEAR(std::to_integer<int>(payload[244 + 2 * i]), luma, 1.5);
    if (i % 2 == 0) {
      const double u = 128 + (-37.797 * at(2) - 74.203 * at(1) + 112.0 * at(0)) / 255.0;
      EXPECT_NEAR(std::to_integer<int>(payload[244 + 2 * i + 1]), u, 1.5);
    }
  }
}

TEST_F(D435iTest, TakesOfARecordingWhatTheRateAsksFor) {
  add_frames(60);
  plug();
  ASSERT_TRUE(commit(1, 1, 5, 1666665));
  EXPECT_EQ(fetch(0x82, Duration{2'100'000'000}).size(), 12U) << "6 frames a second for 2 s";
}

TEST_F(D435iTest, AllFormatsAreOfTheirSize) {
  add_frames(60);
  plug();
  struct Format {
    std::uint8_t interface, endpoint, format, frame;
    std::size_t bytes;
  };
  for (const Format& f : {Format{1, 0x82, 2, 1, 256U * 144 * 2},
                          {1, 0x82, 1, 6, 848U * 100 * 2},
                          {1, 0x82, 1, 8, 1280U * 720 * 2},
                          {2, 0x83, 1, 5, kPixels},
                          {2, 0x83, 2, 5, kPixels * 2},
                          {2, 0x83, 3, 7, 848U * 480},
                          {2, 0x83, 4, 9, 1280U * 800 * 2},
                          {2, 0x83, 5, 1, 640U * 400 * 3},
                          {4, 0x84, 1, 9, 1920U * 1080 * 2},
                          {4, 0x84, 2, 1, 1920U * 1080 * 2}}) {
    ASSERT_TRUE(commit(f.interface, f.format, f.frame, k30Fps));
    const auto payloads = fetch(f.endpoint, Duration{80'000'000});
    ASSERT_FALSE(payloads.empty());
    EXPECT_EQ(payloads[0].size(), f.bytes + field<std::uint8_t>(payloads[0], 0));
    ASSERT_TRUE(set(0x02, 1, 0, f.endpoint, {}));
  }
}

TEST_F(D435iTest, TheIdentityIsWhereLibrealsenseReadsIt) {
  plug({.module_serial = "0123456789ab", .firmware = {5, 12, 7, 100}});
  const Bytes identity = monitor_data(0x10);
  ASSERT_GE(identity.size(), 216U);
  EXPECT_EQ(Bytes(identity.begin() + 12, identity.begin() + 16), bytes_of({100, 7, 12, 5}));
  EXPECT_EQ(Bytes(identity.begin() + 48, identity.begin() + 54),
            bytes_of({0x01, 0x23, 0x45, 0x67, 0x89, 0xab}));
  EXPECT_EQ(Bytes(identity.begin() + 112, identity.begin() + 114), bytes_of({0xff, 0xff}));
  EXPECT_EQ(field<std::uint8_t>(identity, 124), 0x1f);
}

/// The checksum in a table's header is that of what follows it; zlib knows how.
void expect_checked(const Bytes& table, std::size_t size, std::uint16_t type) {
  ASSERT_EQ(table.size(), size);
  EXPECT_EQ(field<std::uint16_t>(table, 2), type);
  EXPECT_EQ(field<std::uint32_t>(table, 4), size - 16);
  const void* content = table.data() + 16;
  EXPECT_EQ(field<std::uint32_t>(table, 12),
            crc32(0, static_cast<const Bytef*>(content), static_cast<uInt>(size - 16)));
}

TEST_F(D435iTest, TheDepthTableHasTheWorldsIntrinsics) {
  plug();
  const Bytes table = monitor_data(0x15, {25, 0, 0, 0});
  expect_checked(table, 512, 25);
  EXPECT_FLOAT_EQ(real(table, 160), -50.0F);
  const std::size_t vga = 256 + 2 * 16;
  EXPECT_FLOAT_EQ(real(table, vga), 600.5F);
  EXPECT_FLOAT_EQ(real(table, vga + 4), 601.25F);
  EXPECT_FLOAT_EQ(real(table, vga + 8), 322.125F);
  EXPECT_FLOAT_EQ(real(table, vga + 12), 238.75F);
  // 848 x 480 is as wide as it can be, and cut above and below.
  const std::size_t wide = 256 + 3 * 16;
  EXPECT_FLOAT_EQ(real(table, wide), 600.5F * 848.0F / 640.0F);
  EXPECT_FLOAT_EQ(real(table, wide + 12), 240.0F + (238.75F - 240.0F) * 848.0F / 640.0F);
}

TEST_F(D435iTest, TheColorTableGivesTheIntrinsicsOfEachSize) {
  plug();
  const Bytes table = monitor_data(0x15, {32, 0, 0, 0});
  expect_checked(table, 256, 32);
  // As librealsense reads it, for 640 x 480: the aspect is the calibration's own.
  EXPECT_EQ(field<std::uint16_t>(table, 144), 640);
  EXPECT_EQ(field<std::uint16_t>(table, 146), 480);
  EXPECT_NEAR(real(table, 16) * 640 / 2, 600.5, 1e-3);
  EXPECT_NEAR(real(table, 16 + 4 * 4) * 480 / 2, 601.25, 1e-3);
  EXPECT_NEAR((1 + real(table, 16 + 6 * 4)) * 640 / 2, 322.125, 1e-3);
  EXPECT_NEAR((1 + real(table, 16 + 7 * 4)) * 480 / 2, 238.75, 1e-3);
}

TEST_F(D435iTest, EachDepthSizeHasItsIntrinsics) {
  plug();
  const Bytes sizes = monitor_data(0x7e);
  ASSERT_EQ(sizes.size(), 8U * 20);
  // 848 x 100 are rows of 848 x 480, from 190 on.
  const auto item = [&](std::size_t i) { return std::span{sizes}.subspan(20 * i, 20); };
  EXPECT_EQ(field<std::uint16_t>(item(5), 2), 100);
  EXPECT_FLOAT_EQ(real(item(5), 4), real(item(6), 4));
  EXPECT_FLOAT_EQ(real(item(5), 16), real(item(6), 16) - 190.0F);
}

TEST_F(D435iTest, TheMotionTableSaysWhereTheImuIs) {
  const SE3 T_imu_cam = world->calibration().T_cam_imu->inverse();
  plug();
  const Bytes table = monitor_data(0x4f, {0, 520, 0, 0});
  expect_checked(table, 520, 0);
  EXPECT_EQ(Bytes(table.begin(), table.begin() + 2), bytes_of({1, 1}));
  EXPECT_EQ(Bytes(table.begin() + 48, table.begin() + 50), bytes_of({1, 0}));
  const Matrix3d R_imu_cam = T_imu_cam.rotation_matrix();
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) {
      EXPECT_NEAR(real(table, 52 + 4 * static_cast<std::size_t>(3 * column + row)),
                  R_imu_cam(row, column), 1e-6);
    }
    EXPECT_NEAR(real(table, 88 + 4 * static_cast<std::size_t>(column)),
                T_imu_cam.translation()[column], 1e-6);
  }
}

TEST_F(D435iTest, WithoutAnImuThereIsNoMotionTable) {
  world->edit_calibration().T_cam_imu.reset();
  plug();
  EXPECT_EQ(field<std::int32_t>(monitor(0x4f, {0, 520, 0, 0}), 0), -21);
}

TEST_F(D435iTest, AUnitOfDepthOtherThanAMillimetreIsSaidByAdvancedMode) {
  plug();
  EXPECT_EQ(monitor_data(0x30), bytes_of({0}));
  world = std::make_unique<ScriptedWorld>();
  world->edit_calibration().depth_unit_m = 2e-4;
  plug();
  EXPECT_EQ(monitor_data(0x30), bytes_of({1}));
  EXPECT_EQ(field<std::uint32_t>(monitor_data(0x2c, {9, 0, 0, 0}), 0), 200U);
  world = std::make_unique<ScriptedWorld>();
  world->edit_calibration().depth_unit_m = 1.5e-6;
  EXPECT_FALSE(D435i::create({}, std::move(world)));
}

TEST_F(D435iTest, TheMonitorTellsTheDeviceTimeAndItWraps) {
  plug({.clock_start_us = 0xffffffffU});
  EXPECT_EQ(field<std::uint32_t>(monitor_data(1, {0x0001613c, 0x00016140, 0, 0}), 0), 0xffffffffU);
  now += Duration{1'000'000};
  EXPECT_EQ(field<std::uint32_t>(monitor_data(1, {0x0001613c, 0x00016140, 0, 0}), 0), 999U);
}

TEST_F(D435iTest, WhatTheMonitorDoesNotKnowIsAnError) {
  plug();
  EXPECT_EQ(field<std::int32_t>(monitor(0xee), 0), -1);
  EXPECT_EQ(field<std::int32_t>(monitor(0x15, {99, 0, 0, 0}), 0), -17);
  EXPECT_EQ(field<std::int32_t>(monitor(0x4f, {0, 0xffffffff, 0, 0}), 0), -6);
  EXPECT_TRUE(set(0x21, 1, 0x0100, 0x0300, Bytes(1024, std::byte{0xff})));
  EXPECT_EQ(field<std::int32_t>(get(0xa1, 0x81, 0x0100, 0x0300, 1024).value_or(Bytes(4)), 0), -1);
}

TEST_F(D435iTest, AResetTakesItOffTheBusForAWhile) {
  plug();
  ASSERT_TRUE(camera->connected(now));
  (void)camera->control({0x21, 1, 0x0100, 0x0300, 1024},
                        ByteWriter{}.u16(20).u16(0xcdab).u32(0x20).pad_to(1024).take(), now);
  EXPECT_FALSE(camera->connected(now));
  EXPECT_FALSE(get(0x80, 6, 0x0100, 0, 18));
  const HostTime back = camera->next_due(0x82, now);
  EXPECT_NEAR(to_seconds(back - now), 4.5, 1.5);
  now = back;
  EXPECT_TRUE(camera->connected(now));
  EXPECT_EQ(descriptor(0x0100).size(), 18U);
}

TEST_F(D435iTest, ControlsHaveRangesAndKeepWhatIsSet) {
  plug();
  const std::uint16_t laser = 0x0400;
  EXPECT_EQ(get(0xa1, 0x83, laser, 0x0300, 2), bytes_of({0x68, 1}));  // 360 mW at most
  EXPECT_EQ(get(0xa1, 0x81, laser, 0x0300, 2), bytes_of({150, 0}));
  EXPECT_TRUE(set(0x21, 1, laser, 0x0300, bytes_of({90, 0})));
  EXPECT_EQ(get(0xa1, 0x81, laser, 0x0300, 2), bytes_of({90, 0}));
  EXPECT_FALSE(set(0x21, 1, laser, 0x0300, bytes_of({0, 2})));
  EXPECT_EQ(get(0xa1, 0x81, 0x0200, 0, 1), bytes_of({4})) << "why: out of range";
  const std::uint16_t brightness = 0x0200;
  EXPECT_EQ(get(0xa1, 0x82, brightness, 0x0703, 2), bytes_of({0xc0, 0xff}));  // -64
  EXPECT_FALSE(get(0xa1, 0x81, 0x0e00, 0x0300, 2)) << "selector 14 is not announced";
}

std::optional<Bytes> switch_on(D435iTest& test, std::uint8_t id, std::uint16_t interval_ms) {
  const Bytes feature = ByteWriter{}.put(id).u8(1).u8(2).u8(2).u8(0).put(interval_ms).u16(0).take();
  EXPECT_TRUE(test.set(0x21, 9, static_cast<std::uint16_t>(0x0300U | id), 5, feature));
  return test.get(0xa1, 1, static_cast<std::uint16_t>(0x0300U | id), 5, 9);
}

TEST_F(D435iTest, TheImuSpeaksInTheChipsAxesWhenItIsSwitchedOn) {
  const ImuSample sample{.accel_mps2 = {1.0, -9.80665, 2.0}, .gyro_radps = {0.5, -0.25, 1.0}};
  for (int i = 0; i < 200; ++i) {
    world->add_imu(sample, (i + 1) * Duration{5'000'000});
  }
  plug({.clock_start_us = 7'000'000});
  EXPECT_TRUE(fetch(0x86, Duration{50'000'000}).empty());
  const auto feature = switch_on(*this, 1, 500);
  ASSERT_TRUE(feature);
  EXPECT_EQ(field<std::uint8_t>(*feature, 3), 2);
  EXPECT_EQ(field<std::uint16_t>(*feature, 5), 500);
  switch_on(*this, 2, 500);
  const auto reports = fetch(0x86, Duration{501'000'000});
  ASSERT_EQ(reports.size(), 200U) << "accelerometer and gyroscope, 200 Hz";
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const Bytes& report = reports[i];
    ASSERT_EQ(report.size(), 32U);
    const bool accel = field<std::uint8_t>(report, 0) == 1;
    EXPECT_NEAR(static_cast<double>(field<std::uint64_t>(report, 2)),
                7'055'000.0 + static_cast<double>(i / 2) * 5000.0, 1.0);
    const Vector3d raw{static_cast<double>(field<std::int16_t>(report, 10)),
                       static_cast<double>(field<std::int16_t>(report, 12)),
                       static_cast<double>(field<std::int16_t>(report, 14))};
    const Vector3d aligned{-raw.x(), raw.y(), -raw.z()};
    const double unit = accel ? 0.00980665 : 0.1 * std::numbers::pi / 180;
    const Vector3d& truth = accel ? sample.accel_mps2 : sample.gyro_radps;
    EXPECT_LE((aligned * unit - truth).cwiseAbs().maxCoeff(), unit / 2 + 1e-9);
  }
}

TEST_F(D435iTest, LinuxSetsAnIntervalBeforeItKnowsThePowerState) {
  plug();
  const auto power = [&](const std::optional<Bytes>& feature) {
    return feature ? field<std::uint8_t>(*feature, 3) : 0;
  };
  EXPECT_TRUE(set(0x21, 9, 0x0302, 5, bytes_of({2, 0, 0, 0, 0, 0xf4, 1, 0, 0})));
  auto feature = get(0xa1, 1, 0x0302, 5, 9);
  EXPECT_EQ(power(feature), 6) << "off, as before";
  EXPECT_EQ(field<std::uint16_t>(feature.value_or(Bytes(9)), 5), 500);
  EXPECT_FALSE(set(0x21, 9, 0x0302, 5, bytes_of({2, 0, 0, 7, 0, 0xf4, 1, 0, 0})));
}

TEST_F(D435iTest, TheLatestReportCanBeAskedFor) {
  world->add_imu({.accel_mps2 = {0, 9.80665, 0}}, {});
  plug();
  for (const unsigned id : {1U, 2U, 3U}) {
    const auto none = get(0xa1, 1, static_cast<std::uint16_t>(0x0100U | id), 5, 64);
    ASSERT_TRUE(none);
    EXPECT_EQ(none->size(), id == 3 ? 26U : 32U);
    EXPECT_EQ(field<std::uint8_t>(*none, 0), id);
  }
  switch_on(*this, 1, 500);
  EXPECT_EQ(get(0xa1, 1, 0x0101, 5, 64), fetch(0x86, kMillisecond).at(0));
  EXPECT_FALSE(get(0xa1, 1, 0x0104, 5, 64));
}

TEST_F(D435iTest, NewerFirmwareReportsFinerRates) {
  const ImuSample sample{.accel_mps2 = {0, 0, 9.80665}, .gyro_radps = {0.0123, 0, 0}};
  world->add_imu(sample, {});
  plug({.firmware = {5, 16, 0, 1}});
  switch_on(*this, 2, 500);
  const auto reports = fetch(0x86, kMillisecond);
  ASSERT_EQ(reports.size(), 1U);
  ASSERT_EQ(reports[0].size(), 38U);
  EXPECT_NEAR(field<std::int32_t>(reports[0], 10), -0.0123 * 180 / std::numbers::pi / 1e-4, 1.0);
}

TEST_F(D435iTest, RefusesWhatNoD435iIs) {
  EXPECT_FALSE(D435i::create({.module_serial = "12"}, std::make_unique<ScriptedWorld>()));
  EXPECT_FALSE(D435i::create({.firmware = {6, 0, 0, 0}}, std::make_unique<ScriptedWorld>()));
}

}  // namespace
}  // namespace geoflow::emulator
