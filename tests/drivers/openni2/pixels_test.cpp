#include "openni2/pixels.hpp"

#include <cstddef>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::openni2 {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::byte> bytes_of(const std::vector<int>& values) {
  std::vector<std::byte> bytes;
  for (const int value : values) {
    bytes.push_back(static_cast<std::byte>(value));
  }
  return bytes;
}

/// Two pixels in a row.
std::vector<int> converted(SourcePixel pixel, const std::vector<int>& source, PixelFormat format) {
  const auto bytes = bytes_of(source);
  const ImageShape shape{.width = 2, .height = 1, .format = format};
  std::vector<std::byte> target(shape.size_bytes());
  const auto done =
      convert({.pixel = pixel, .width = 2, .height = 1, .step_bytes = bytes.size(), .bytes = bytes},
              shape, target);
  EXPECT_TRUE(done) << (done ? "" : done.error().message);
  std::vector<int> values;
  for (const std::byte byte : target) {
    values.push_back(std::to_integer<int>(byte));
  }
  return values;
}

TEST(OpenNi2Pixels, BecomeBgrGrayOrDepth) {
  EXPECT_THAT(converted(SourcePixel::kRgb888, {1, 2, 3, 4, 5, 6}, PixelFormat::kBgr8),
              ElementsAre(3, 2, 1, 6, 5, 4));
  // 0.299 red; 0.587 green.
  EXPECT_THAT(converted(SourcePixel::kRgb888, {200, 0, 0, 0, 200, 0}, PixelFormat::kGray8),
              ElementsAre(60, 117));
  EXPECT_THAT(converted(SourcePixel::kGray8, {7, 8}, PixelFormat::kBgr8),
              ElementsAre(7, 7, 7, 8, 8, 8));
  EXPECT_THAT(converted(SourcePixel::kGray8, {7, 8}, PixelFormat::kGray8), ElementsAre(7, 8));
  EXPECT_THAT(converted(SourcePixel::kDepth, {1, 2, 3, 4}, PixelFormat::kDepth16),
              ElementsAre(1, 2, 3, 4));
}

TEST(OpenNi2Pixels, UyvyIsYuyvInAnotherOrder) {
  for (const PixelFormat format : {PixelFormat::kBgr8, PixelFormat::kGray8}) {
    EXPECT_EQ(converted(SourcePixel::kUyvy, {90, 81, 240, 145}, format),
              converted(SourcePixel::kYuyv, {81, 90, 145, 240}, format));
  }
  EXPECT_THAT(converted(SourcePixel::kUyvy, {90, 81, 240, 145}, PixelFormat::kGray8),
              ElementsAre(81, 145));
}

TEST(OpenNi2Pixels, RowsMayBePaddedButNotCutOff) {
  const ImageShape shape{.width = 2, .height = 2, .format = PixelFormat::kGray8};
  const auto bytes = bytes_of({1, 2, 99, 3, 4});
  std::vector<std::byte> target(shape.size_bytes());
  SourceImage source{
      .pixel = SourcePixel::kGray8, .width = 2, .height = 2, .step_bytes = 3, .bytes = bytes};
  ASSERT_TRUE(convert(source, shape, target));
  EXPECT_EQ(target, bytes_of({1, 2, 3, 4}));
  source.bytes = source.bytes.first(4);
  EXPECT_THAT(convert(source, shape, target).error().message, HasSubstr("4 bytes, 2x2"));
  source.bytes = bytes;
  source.step_bytes = 1;
  EXPECT_FALSE(convert(source, shape, target));
  source.step_bytes = 3;
  source.width = 3;
  EXPECT_THAT(convert(source, shape, target).error().message, HasSubstr("2x2 is expected"));
  EXPECT_EQ(convert(source, {.width = 2, .height = 2, .format = PixelFormat::kDepth16}, target)
                .error()
                .code,
            ErrorCode::kUnsupported);
}

}  // namespace
}  // namespace geoflow::drivers::openni2
