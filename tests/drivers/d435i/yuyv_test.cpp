#include "d435i/pixels/yuyv.hpp"

#include <array>
#include <cstddef>

#include <gtest/gtest.h>

#include "geoflow/hal/image.hpp"

#include "d435i/bytes.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

TEST(Yuyv, GrayIsTheLumaAsItIs) {
  Bytes gray(4);
  ASSERT_TRUE(convert_yuyv(from_hex("01 80 02 80 fe 00 ff ff"), {4, 1, PixelFormat::kGray8}, gray));
  EXPECT_EQ(gray, from_hex("01 02 fe ff"));
}

/// The colour of one pair of equal pixels.
std::array<int, 3> bgr_of(unsigned y, unsigned u, unsigned v) {
  Bytes bgr(6);
  EXPECT_TRUE(convert_yuyv(Builder{}.u8({y, u, y, v}).get(), {2, 1, PixelFormat::kBgr8}, bgr));
  EXPECT_EQ(bgr[0], bgr[3]);
  return {std::to_integer<int>(bgr[0]), std::to_integer<int>(bgr[1]), std::to_integer<int>(bgr[2])};
}

TEST(Yuyv, ColoursAreThoseOfBt601) {
  // BT.601's 100 % bars.
  EXPECT_EQ(bgr_of(235, 128, 128), (std::array{255, 255, 255}));
  EXPECT_EQ(bgr_of(16, 128, 128), (std::array{0, 0, 0}));
  const auto near = [](std::array<int, 3> found, std::array<int, 3> expected) {
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(found.at(i), expected.at(i), 2) << "channel " << i;
    }
  };
  near(bgr_of(81, 90, 240), {0, 0, 255});
  near(bgr_of(145, 54, 34), {0, 255, 0});
  near(bgr_of(41, 240, 110), {255, 0, 0});
}

TEST(Yuyv, RgbIsBgrBackwards) {
  const Bytes yuyv = from_hex("51 5a 30 f0 91 36 80 22");
  Bytes bgr(12);
  Bytes rgb(12);
  ASSERT_TRUE(convert_yuyv(yuyv, {4, 1, PixelFormat::kBgr8}, bgr));
  ASSERT_TRUE(convert_yuyv(yuyv, {4, 1, PixelFormat::kRgb8}, rgb));
  for (std::size_t i = 0; i < bgr.size(); i += 3) {
    EXPECT_EQ(rgb[i], bgr[i + 2]);
    EXPECT_EQ(rgb[i + 1], bgr[i + 1]);
    EXPECT_EQ(rgb[i + 2], bgr[i]);
  }
}

TEST(Yuyv, RefusesOtherSizesAndFormats) {
  Bytes target(16);
  EXPECT_FALSE(convert_yuyv(from_hex("01 80 02"), {2, 1, PixelFormat::kGray8}, target));
  EXPECT_FALSE(convert_yuyv(from_hex("01 80 02 80"), {2, 1, PixelFormat::kDepth16}, target));
  EXPECT_FALSE(convert_yuyv(from_hex("01 80 02 80 05 06"), {3, 1, PixelFormat::kGray8}, target));
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
