#include "d435i/usb/assembler.hpp"

#include <cstddef>
#include <string_view>

#include <gtest/gtest.h>

#include "d435i/bytes.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

constexpr std::string_view kFirst = "02 80";   // FID 0
constexpr std::string_view kLast = "02 82";    // FID 0, end of frame
constexpr std::string_view kSecond = "02 81";  // FID 1
constexpr std::string_view kSecondEnd = "02 83";

Bytes payload(std::string_view header, std::string_view data) {
  return Builder{}.hex(header).hex(data).get();
}

TEST(FrameAssembler, AFrameInOnePayloadIsPassedOnWhereItLies) {
  FrameAssembler assembler{4};
  const Bytes whole = payload(kLast, "01 02 03 04");
  const auto outcome = assembler.add(whole);
  EXPECT_EQ(outcome.pixels.data(), whole.data() + 2);
  EXPECT_EQ(outcome.pixels.size(), 4U);
  EXPECT_EQ(outcome.header.size(), 2U);
  EXPECT_TRUE(outcome.damage.empty());
}

TEST(FrameAssembler, AFrameInSeveralIsCollected) {
  FrameAssembler assembler{4};
  EXPECT_TRUE(assembler.add(payload(kFirst, "01 02")).pixels.empty());
  EXPECT_TRUE(assembler.add(payload(kFirst, "03")).pixels.empty());
  const Bytes last = payload(kLast, "04");
  const auto outcome = assembler.add(last);
  EXPECT_EQ(Bytes(outcome.pixels.begin(), outcome.pixels.end()), from_hex("01 02 03 04"));
  EXPECT_EQ(Bytes(outcome.header.begin(), outcome.header.end()), from_hex(kFirst));
  // The next one starts anew.
  EXPECT_EQ(assembler.add(payload(kSecondEnd, "05 06 07 08")).pixels.size(), 4U);
}

TEST(FrameAssembler, AShortFrameIsGivenUp) {
  FrameAssembler assembler{4};
  const auto cut = assembler.add(payload(kLast, "01 02 03"));
  EXPECT_TRUE(cut.pixels.empty());
  EXPECT_EQ(cut.damage, "a frame ended early");
  EXPECT_EQ(assembler.add(payload(kSecondEnd, "01 02 03 04")).pixels.size(), 4U);
}

TEST(FrameAssembler, AToggleBeforeTheEndGivesUpTheFrameBefore) {
  FrameAssembler assembler{4};
  EXPECT_TRUE(assembler.add(payload(kFirst, "01 02")).damage.empty());
  const Bytes second = payload(kSecondEnd, "05 06 07 08");
  const auto next = assembler.add(second);
  EXPECT_EQ(next.damage, "a frame ended early");
  EXPECT_EQ(Bytes(next.pixels.begin(), next.pixels.end()), from_hex("05 06 07 08"));
}

TEST(FrameAssembler, ALongOneIsGivenUpToItsEnd) {
  FrameAssembler assembler{4};
  EXPECT_EQ(assembler.add(payload(kFirst, "01 02 03 04 05")).damage, "a frame is too long");
  EXPECT_TRUE(assembler.add(payload(kFirst, "06 07 08 09")).pixels.empty());
  EXPECT_TRUE(assembler.add(payload(kLast, "")).pixels.empty());
  EXPECT_EQ(assembler.add(payload(kSecondEnd, "01 02 03 04")).pixels.size(), 4U);
}

TEST(FrameAssembler, WhatTheCameraCallsDamagedIsNotAFrame) {
  FrameAssembler assembler{4};
  const auto outcome = assembler.add(payload("02 c2", "01 02 03 04"));
  EXPECT_TRUE(outcome.pixels.empty());
  EXPECT_EQ(outcome.damage, "the camera says that a frame is damaged");
}

TEST(FrameAssembler, AHeaderThatCannotBeReadEndsAFrame) {
  FrameAssembler assembler{4};
  EXPECT_TRUE(assembler.add(payload(kFirst, "01 02")).damage.empty());
  EXPECT_FALSE(assembler.add(from_hex("ff 80 00")).damage.empty());
  EXPECT_TRUE(assembler.add({}).damage.empty());  // an empty transfer says nothing
  EXPECT_TRUE(assembler.add(payload(kFirst, "03 04")).pixels.empty());
  EXPECT_TRUE(assembler.add(payload(kSecond, "")).pixels.empty());
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
