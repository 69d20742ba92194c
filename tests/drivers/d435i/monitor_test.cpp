#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/bytes.hpp"
#include "d435i/golden.hpp"
#include "d435i/monitor/command.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/monitor/versions.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

/// A reply of 1024 bytes: the opcode's echo, data, and its length at the end.
Bytes reply(std::uint32_t echo, const Bytes& data, std::size_t length) {
  Builder built;
  built.u32(echo).bytes(data);
  return built.zeros(1020 - built.size()).u32(length).get();
}

TEST(MonitorCommand, IsFramedAsTheFirmwareReadsIt) {
  const Bytes request =
      encode_command({.opcode = Opcode::kCalibrationTable, .parameters = {25, 0, 0, 0}});
  ASSERT_EQ(request.size(), 1024U);
  EXPECT_EQ(Bytes(request.begin(), request.begin() + 24),
            from_hex("14 00 ab cd 15 00 00 00 19 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"));
  const Bytes data = from_hex("01 02 03");
  const Bytes with_data = encode_command({.opcode = Opcode::kVersions, .data = data});
  EXPECT_EQ(with_data[0], std::byte{23});
  EXPECT_EQ(with_data[26], std::byte{3});
}

TEST(MonitorCommand, AReplyIsAsLongAsItsLastBytesSay) {
  const Bytes data = from_hex("aa bb cc dd");
  const Bytes whole = reply(0x10, data, 4);
  const auto found = parse_reply(whole, Opcode::kVersions);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(Bytes(found->begin(), found->end()), data);
  EXPECT_FALSE(parse_reply(reply(0x10, data, 1017), Opcode::kVersions));
  EXPECT_FALSE(parse_reply(std::span{whole}.first(1023), Opcode::kVersions));
}

TEST(MonitorCommand, TheFirmwaresErrorsAreWords) {
  const auto error_of = [](int number) {
    return parse_reply(reply(static_cast<std::uint32_t>(number), {}, 0), Opcode::kImuCalibration);
  };
  const auto none = error_of(-21);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().message, "hardware monitor, command 0x4f: no data to return (-21)");
  EXPECT_EQ(error_of(-7).error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(error_of(-1).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(error_of(-12345).error().code, ErrorCode::kInvalidData);
}

TEST(MonitorCommand, TheClockIsReadFromItsAddress) {
  const Bytes request = encode_clock_command();
  EXPECT_EQ(Bytes(request.begin() + 4, request.begin() + 16),
            from_hex("01 00 00 00 3c 61 01 00 40 61 01 00"));
  const auto clock_us = parse_clock_us(from_hex("78 56 34 f2"));
  ASSERT_TRUE(clock_us);
  EXPECT_EQ(*clock_us, 0xf2345678U);
  EXPECT_FALSE(parse_clock_us(from_hex("78 56 34")));
}

TEST(Versions, AreReadWhereTheFirmwarePutsThem) {
  const auto versions = parse_versions(golden_versions());
  ASSERT_TRUE(versions) << versions.error().message;
  EXPECT_EQ(versions->firmware.text(), "5.12.7.100");
  EXPECT_EQ(versions->serial, "831122070153");
  EXPECT_EQ(versions->asic_serial, "850123050307");
  EXPECT_TRUE(versions->has_color);
  EXPECT_TRUE(versions->has_imu);
  EXPECT_LT(versions->firmware, (FirmwareVersion{{5, 16, 0, 0}}));
  EXPECT_FALSE(parse_versions(Bytes(178)));
}

TEST(DepthTable, GivesIntrinsicsByResolution) {
  const Bytes bytes = golden_depth_table();
  ASSERT_EQ(bytes.size(), 512U);
  const auto table = parse_depth_table(bytes);
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_NEAR(table->baseline_m, 0.04995, 1e-8);
  const auto listed = depth_intrinsics(*table, 848, 480);
  ASSERT_TRUE(listed);
  EXPECT_NEAR(listed->fx, 422.8, 1e-4);
  EXPECT_NEAR(listed->cy, 235.7, 1e-4);
  const auto strip = depth_intrinsics(*table, 848, 100);
  ASSERT_TRUE(strip);
  EXPECT_NEAR(strip->cy, 235.7 - 190, 1e-4);
  EXPECT_NEAR(strip->cx, 423.8, 1e-4);
  const auto middle = depth_intrinsics(*table, 256, 144);
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->fx, 957.2, 1e-4);
  EXPECT_NEAR(middle->cx, 959.5 - 832, 1e-4);
  EXPECT_NEAR(middle->cy, 538.2 - 468, 1e-4);
  const auto scaled = depth_intrinsics(*table, 960, 540);
  ASSERT_TRUE(scaled);
  EXPECT_NEAR(scaled->fx, 957.2 / 2, 1e-4);
}

TEST(DepthTable, RefusesAWrongChecksumTypeOrLength) {
  Bytes flipped = golden_depth_table();
  flipped[300] ^= std::byte{1};
  const auto damaged = parse_depth_table(flipped);
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.error().message.find("checksum"), std::string::npos);
  const auto other = parse_depth_table(golden_color_table());
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().message.find("table 32 instead of 25"), std::string::npos);
  EXPECT_FALSE(parse_depth_table(with_table_header(25, Bytes(100))));
  EXPECT_FALSE(parse_depth_table(Bytes(15)));
}

TEST(ColorTable, GivesIntrinsicsAndPose) {
  const Bytes bytes = golden_color_table();
  ASSERT_EQ(bytes.size(), 256U);
  const auto table = parse_color_table(bytes);
  ASSERT_TRUE(table) << table.error().message;
  const CameraIntrinsics vga = color_intrinsics(*table, 640, 480);
  EXPECT_NEAR(vga.fx, 612.4, 1e-3);
  EXPECT_NEAR(vga.fy, 610.6, 1e-3);
  EXPECT_NEAR(vga.cx, 314.3, 1e-3);
  EXPECT_NEAR(vga.cy, 237.8, 1e-3);
  EXPECT_EQ(vga.model, DistortionModel::kNone);
  // 16:9 at the same height sees more to the sides with the same pixels.
  const CameraIntrinsics wide = color_intrinsics(*table, 1280, 720);
  EXPECT_NEAR(wide.fx, 918.6, 0.05);
  EXPECT_NEAR(wide.fy, 915.9, 0.05);
  EXPECT_NEAR(wide.cx, 631.4, 0.1);
  EXPECT_NEAR(wide.cy, 356.7, 0.1);
  const Vector3d p_depth_cam = table->T_depth_cam.translation();
  EXPECT_TRUE(p_depth_cam.isApprox(Vector3d{-0.01501, 0.00136, -0.00025}, 1e-6));
  EXPECT_NEAR(table->T_depth_cam.rotation_matrix()(1, 0), 0.009402, 1e-5);
}

TEST(ColorTable, RefusesAPoseThatIsNone) {
  Bytes payload = golden_color_table();
  payload.erase(payload.begin(), payload.begin() + 16);
  for (std::size_t i = 168; i < 204; ++i) {
    payload[i] = std::byte{};
  }
  const auto table = parse_color_table(with_table_header(32, payload));
  ASSERT_FALSE(table);
  EXPECT_NE(table.error().message.find("rotation"), std::string::npos) << table.error().message;
}

Bytes imu_table(unsigned has_extrinsics, unsigned has_intrinsics) {
  Builder payload;
  payload.zeros(32).u8({has_extrinsics, has_intrinsics, 0, 0});
  payload.f32s({1, 0, 0, 0, 1, 0, 0, 0, 1}).f32s({-0.006F, 0.005F, 0.012F});
  payload.f32s({1.01F, 0, 0, 0.02F, 1, 0, 0, 0, 1}).f32s({0.1F, 0.2F, 0.3F});
  payload.f32s({1, 0, 0, 0, 1, 0, 0, 0, 1}).f32s({180, 0, 0}).zeros(96);
  return with_table_header(34, payload.get());
}

TEST(ImuTable, GivesWhatItSaysIsValid) {
  const auto full = parse_imu_table(imu_table(1, 1));
  ASSERT_TRUE(full) << full.error().message;
  ASSERT_TRUE(full->T_imu_depth);
  EXPECT_TRUE(full->T_imu_depth->translation().isApprox(Vector3d{-0.006, 0.005, 0.012}, 1e-6));
  EXPECT_NEAR(full->accel_scale(0, 0), 1.01, 1e-6);
  EXPECT_NEAR(full->accel_scale(0, 1), 0.02, 1e-6);  // stored column by column
  EXPECT_NEAR(full->accel_bias_mps2.y(), 0.2, 1e-6);
  EXPECT_NEAR(full->gyro_bias_radps.x(), 3.14159265, 1e-6);
  const auto none = parse_imu_table(imu_table(0, 0));
  ASSERT_TRUE(none);
  EXPECT_FALSE(none->T_imu_depth);
  EXPECT_TRUE(none->accel_scale.isIdentity());
  EXPECT_TRUE(none->gyro_bias_radps.isZero());
}

TEST(ResolutionIntrinsics, AreItemsOfTwentyBytes) {
  const auto list = parse_resolution_intrinsics(
      Builder{}.u16(640).u16(480).f32s({382.9F, 383.0F, 320.1F, 236.2F}).zeros(20).get());
  ASSERT_TRUE(list);
  ASSERT_EQ(list->size(), 1U);
  EXPECT_EQ(list->front().width, 640);
  EXPECT_NEAR(list->front().fy, 383.0, 1e-4);
  EXPECT_FALSE(parse_resolution_intrinsics(Bytes(19)));
}

TEST(DepthUnit, IsInMicrometres) {
  const auto unit_m = parse_depth_unit_m(Builder{}.u32(100).zeros(16).get());
  ASSERT_TRUE(unit_m);
  EXPECT_NEAR(*unit_m, 1e-4, 1e-12);
  EXPECT_FALSE(parse_depth_unit_m(Builder{}.u32(0).get()));
  EXPECT_FALSE(parse_depth_unit_m(Bytes(3)));
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
