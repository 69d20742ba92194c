#include "dds/low_state.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"

#include "dds/low_state_fixture.hpp"

namespace geoflow::drivers::dds {
namespace {

using testing::Each;
using testing::HasSubstr;
using tests::low_state;

constexpr std::size_t kTickAt = 1100;  // in memory: where unitree_sdk2's struct has it
constexpr std::size_t kCrcAt = 1176;

TEST(LowState, TheMemoryImageIsThatOfTheSdksStruct) {
  const LowState state = low_state(100);
  const auto image = memory_image(state);
  std::uint32_t word = 0;
  std::memcpy(&word, &image[kTickAt], sizeof word);
  EXPECT_EQ(word, 200U);
  std::memcpy(&word, &image[kCrcAt], sizeof word);
  EXPECT_EQ(word, state.crc);
  EXPECT_EQ(image[0], std::byte{0xFE});
  // Members stand where this machine's compiler puts them, too.
  LowState copy;
  std::memcpy(&copy, image.data(), image.size());
  EXPECT_EQ(copy.motor_state[19].q, state.motor_state[19].q);
  EXPECT_EQ(copy.bms_state.cell_vol[14], 4014);
  EXPECT_EQ(copy.wireless_remote[39], 0x5A);
  EXPECT_EQ(copy.power_v, 29.5F);
}

// Bit by bit, as unitree_sdk2's crc32_core does it.
std::uint32_t reference_crc(std::span<const std::byte> bytes) {
  std::uint32_t crc = 0xFFFFFFFF;
  for (std::size_t at = 0; at < bytes.size(); at += 4) {
    std::uint32_t word = 0;
    std::memcpy(&word, &bytes[at], sizeof word);
    for (std::uint32_t bit = 1U << 31U; bit != 0; bit >>= 1U) {
      const bool carry = (crc >> 31U) != 0;
      crc <<= 1U;
      crc ^= carry ? 0x04C11DB7U : 0U;
      crc ^= (word & bit) != 0 ? 0x04C11DB7U : 0U;
    }
  }
  return crc;
}

TEST(LowState, TheChecksumIsTheSdks) {
  for (const std::uint32_t number : {0U, 1U, 77U}) {
    const auto image = memory_image(low_state(number));
    EXPECT_EQ(checksum(low_state(number)), reference_crc(std::span{image}.first(kCrcAt)));
  }
}

TEST(LowState, CdrGoesThereAndBack) {
  const LowState state = low_state(5);
  const auto bytes = encode(state);
  const auto back = decode(bytes);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(memory_image(*back), memory_image(state));
}

TEST(LowState, AWrongLengthIsAnErrorThatSaysWhere) {
  auto bytes = encode(low_state(5));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode(std::span{bytes}.first(size))) << size;
  }
  EXPECT_THAT(decode(std::span{bytes}.first(500)).error().message,
              HasSubstr("LowState: the CDR message ends at byte 500"));
  bytes.resize(bytes.size() + 3);  // padding of the transport
  EXPECT_TRUE(decode(bytes));
  bytes.resize(bytes.size() + 1);
  EXPECT_THAT(decode(bytes).error().message, HasSubstr("4 bytes are left over"));
}

TEST(LowState, WhatItSaysOfLegsAndImu) {
  const LowState state = low_state(5);
  const auto legs = legs_of(state);
  ASSERT_TRUE(legs);
  EXPECT_EQ(legs->joints[11].q_rad, static_cast<double>(state.motor_state[11].q));
  EXPECT_EQ(legs->joints[4].dq_radps, static_cast<double>(state.motor_state[4].dq));
  EXPECT_EQ(legs->joints[0].tau_nm, static_cast<double>(state.motor_state[0].tau_est));
  EXPECT_THAT(legs->foot_force, testing::ElementsAre(20, 21, -22, 23));
  EXPECT_THAT(legs->valid, Each(true));
  const auto imu = imu_of(state);
  ASSERT_TRUE(imu);
  EXPECT_EQ(imu->gyro_radps.y(), static_cast<double>(-0.2F));
  EXPECT_EQ(imu->accel_mps2.x(), 0.5);
}

TEST(LowState, WhatIsNoNumberIsRefused) {
  LowState state = low_state(5);
  state.motor_state[7].dq = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(legs_of(state).error().message, HasSubstr("motor 7"));
  state.imu_state.gyroscope[2] = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(imu_of(state));
  state = low_state(5);
  state.motor_state[12].q = std::numeric_limits<float>::quiet_NaN();  // none of the legs'
  EXPECT_TRUE(legs_of(state));
}

}  // namespace
}  // namespace geoflow::drivers::dds
