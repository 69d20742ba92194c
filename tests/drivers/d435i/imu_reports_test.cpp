#include <array>
#include <cstdint>
#include <numbers>

#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"

#include "d435i/bytes.hpp"
#include "d435i/imu/reports.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

Bytes short_report(unsigned id, std::uint64_t t_us, std::array<int, 3> axes) {
  Builder built;
  built.u8({id, 3}).u64(t_us);
  for (const int axis : axes) {
    built.u16(static_cast<std::uint16_t>(axis));
  }
  return built.u32(0).u32(0).u16(0).u16(0).u16(0).u8({17, 18}).get();
}

Bytes long_report(unsigned id, std::uint64_t t_us, std::array<int, 3> axes) {
  Builder built;
  built.u8({id, 3}).u64(t_us);
  for (const int axis : axes) {
    built.u32(static_cast<std::uint32_t>(axis));
  }
  return built.u32(0).u32(0).u16(0).u16(0).u16(0).u8({17, 18}).get();
}

TEST(ImuReport, ReadsTheShortLayout) {
  const Bytes report = short_report(1, 0x1'0000'0005ULL, {12, -1000, -7});
  ASSERT_EQ(report.size(), 32U);
  const auto reading = parse_input_report(report);
  ASSERT_TRUE(reading) << reading.error().message;
  EXPECT_EQ(reading->sensor, ImuSensor::kAccelerometer);
  EXPECT_EQ(reading->layout, ImuLayout::k16Bit);
  EXPECT_EQ(reading->t_device_us, 5U);  // the clock of the video stamps has 32 bits
  EXPECT_EQ(reading->counts, (std::array<std::int32_t, 3>{12, -1000, -7}));
}

TEST(ImuReport, ReadsTheLongLayout) {
  const Bytes report = long_report(2, 99, {100'000, -2, 3});
  ASSERT_EQ(report.size(), 38U);
  const auto reading = parse_input_report(report);
  ASSERT_TRUE(reading);
  EXPECT_EQ(reading->sensor, ImuSensor::kGyroscope);
  EXPECT_EQ(reading->layout, ImuLayout::k32Bit);
  EXPECT_EQ(reading->counts, (std::array<std::int32_t, 3>{100'000, -2, 3}));
}

TEST(ImuReport, RefusesOtherLengthsAndSensors) {
  Bytes cut = short_report(1, 1, {0, 0, 0});
  cut.pop_back();
  const auto of_31 = parse_input_report(cut);
  ASSERT_FALSE(of_31);
  EXPECT_EQ(of_31.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(of_31.error().message.find("31 bytes"), std::string::npos);
  EXPECT_FALSE(parse_input_report({}));
  EXPECT_FALSE(parse_input_report(short_report(3, 1, {0, 0, 0})));
  EXPECT_FALSE(parse_input_report(long_report(0, 1, {0, 0, 0})));
}

TEST(ImuReport, AtRestGravityPointsUpInTheCamerasAxes) {
  // Level and at rest the chip reads -1 g along its y; the camera's y points down.
  const auto reading = parse_input_report(short_report(1, 1, {0, -1000, 0}));
  ASSERT_TRUE(reading);
  const Vector3d accel_mps2 = to_si(*reading);
  EXPECT_NEAR(accel_mps2.x(), 0, 1e-12);
  EXPECT_NEAR(accel_mps2.y(), -9.80665, 1e-9);
  EXPECT_NEAR(accel_mps2.z(), 0, 1e-12);
}

TEST(ImuReport, GyroscopeCountsDependOnTheLayout) {
  const double degree = std::numbers::pi / 180;
  const auto coarse = parse_input_report(short_report(2, 1, {10, 20, 30}));
  const auto fine = parse_input_report(long_report(2, 1, {10'000, 20'000, 30'000}));
  ASSERT_TRUE(coarse && fine);
  EXPECT_TRUE(to_si(*coarse).isApprox(degree * Vector3d{-1, 2, -3}, 1e-12));
  EXPECT_TRUE(to_si(*fine).isApprox(to_si(*coarse), 1e-12));
}

TEST(ImuFeature, IsReadAndWrittenInNineBytes) {
  const Bytes wire = from_hex("02 01 02 06 00 f4 01 2c 00");
  const auto feature = parse_feature_report(wire);
  ASSERT_TRUE(feature) << feature.error().message;
  EXPECT_EQ(feature->sensor, ImuSensor::kGyroscope);
  EXPECT_EQ(feature->power, kPowerOff);
  EXPECT_EQ(feature->interval_ms, 500);
  EXPECT_EQ(feature->sensitivity, 44);
  EXPECT_EQ(encode_feature_report(*feature), wire);
  EXPECT_FALSE(parse_feature_report(from_hex("02 01 02 06 00 f4 01 2c")));
  EXPECT_FALSE(parse_feature_report(from_hex("03 01 02 06 00 f4 01 2c 00")));
}

TEST(ImuRates, AreCodes) {
  for (const auto& [hz, code, interval_ms] :
       {std::array{63, 1, 1000}, {100, 1, 1000}, {200, 2, 500}, {250, 3, 333}, {400, 4, 250}}) {
    const auto found = rate_code(hz);
    ASSERT_TRUE(found);
    EXPECT_EQ(*found, code);
    EXPECT_EQ(interval_of(*found), interval_ms);
  }
  EXPECT_FALSE(rate_code(500));
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
