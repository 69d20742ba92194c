#include "replay/decode.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/fixtures.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using tests::message_of;

std::vector<std::byte> encode(const std::string& extension, const cv::Mat& image) {
  std::vector<uchar> encoded;
  cv::imencode(extension, image, encoded);
  const auto bytes = std::as_bytes(std::span{encoded});
  return {bytes.begin(), bytes.end()};
}

EncodedImage compressed(ImageStream stream, std::vector<std::byte> bytes) {
  return {.stream = stream, .bytes = std::move(bytes), .origin = "list:7: file"};
}

/// 8 x 4 pixels that differ from one another.
cv::Mat ramp(int type) {
  cv::Mat image(4, 8, type);
  for (int y = 0; y < image.rows; ++y) {
    for (std::size_t x = 0; x < image.elemSize() * 8; ++x) {
      image.ptr(y)[x] = static_cast<uchar>(16 * y + static_cast<int>(x));
    }
  }
  return image;
}

class Decode : public testing::Test {
 protected:
  Result<FrameRef> decode_with(const EncodedImage& image, const DecodeOptions& options = {}) {
    return decode(image, options, [this](const ImageShape& shape) { return pool_.acquire(shape); });
  }
  FramePool pool_{2};
};

TEST_F(Decode, KeepsEveryBitOfDepth) {
  const cv::Mat image = ramp(CV_16UC1);
  const auto frame = decode_with(compressed(ImageStream::kDepth, encode(".png", image)),
                                 {.width = 8, .height = 4});
  ASSERT_TRUE(frame) << frame.error().message;
  EXPECT_EQ(frame->shape(), (ImageShape{.width = 8, .height = 4, .format = PixelFormat::kDepth16}));
  EXPECT_EQ(std::memcmp(frame->bytes().data(), image.data, frame->bytes().size()), 0);
}

TEST_F(Decode, GivesColorAsBgrOrGray) {
  const cv::Mat image = ramp(CV_8UC3);
  const auto bytes = encode(".png", image);
  const auto color = decode_with(compressed(ImageStream::kColor, bytes));
  ASSERT_TRUE(color);
  EXPECT_EQ(color->shape().format, PixelFormat::kBgr8);
  EXPECT_EQ(std::memcmp(color->bytes().data(), image.data, color->bytes().size()), 0);
  const auto gray = decode_with(compressed(ImageStream::kColor, bytes), {.color_as_gray = true});
  ASSERT_TRUE(gray);
  EXPECT_EQ(gray->shape().format, PixelFormat::kGray8);
}

TEST_F(Decode, ReadsJpegColor) {
  const auto frame = decode_with(
      compressed(ImageStream::kColor, encode(".jpg", cv::Mat(4, 8, CV_8UC3, cv::Scalar::all(90)))),
      {.width = 8, .height = 4, .color_as_gray = true});
  ASSERT_TRUE(frame) << frame.error().message;
  EXPECT_EQ(frame->row<std::uint8_t>(2)[3], 90);
}

TEST_F(Decode, NamesSizeAndKindThatDoNotFit) {
  const auto depth = encode(".png", ramp(CV_16UC1));
  EXPECT_THAT(message_of(decode_with(compressed(ImageStream::kDepth, depth),
                                     {.width = 640, .height = 480})),
              AllOf(HasSubstr("list:7: file"),
                    HasSubstr("8 x 4 pixels, but the calibration is for 640 x 480")));
  EXPECT_THAT(
      message_of(decode_with(compressed(ImageStream::kDepth, encode(".png", ramp(CV_8UC1))))),
      AllOf(HasSubstr("list:7"), HasSubstr("a PNG of 8 bits")));
  EXPECT_THAT(
      message_of(decode_with(compressed(ImageStream::kDepth, encode(".jpg", ramp(CV_8UC3))))),
      HasSubstr("a JPEG of 8 bits in colour"));
  EXPECT_THAT(message_of(decode_with(compressed(ImageStream::kColor, std::vector<std::byte>(100)))),
              HasSubstr("neither a PNG nor a JPEG"));
}

TEST_F(Decode, RefusesEveryCutOfAnImage) {
  for (const char* extension : {".png", ".jpg"}) {
    const auto whole = encode(extension, ramp(CV_8UC3));
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::vector<std::byte> cut(whole.begin(),
                                       whole.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_FALSE(decode_with(compressed(ImageStream::kColor, cut)))
          << extension << " cut to " << size;
    }
  }
}

TEST_F(Decode, SurvivesEveryFlippedByte) {
  for (const char* extension : {".png", ".jpg"}) {
    const auto whole = encode(extension, ramp(CV_8UC3));
    for (std::size_t at = 0; at < whole.size(); ++at) {
      auto damaged = whole;
      damaged[at] ^= std::byte{0xff};
      const auto frame =
          decode_with(compressed(ImageStream::kColor, damaged), {.width = 8, .height = 4});
      if (frame) {
        EXPECT_EQ(frame->shape().width, 8);
      }
    }
  }
}

TEST_F(Decode, SaysThatNoBufferIsFree) {
  const auto image = compressed(ImageStream::kDepth, encode(".png", ramp(CV_16UC1)));
  const auto first = decode_with(image);
  const auto second = decode_with(image);
  const auto third = decode_with(image);
  ASSERT_TRUE(first && second);
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().code, ErrorCode::kUnavailable);
}

EncodedImage raw(ImageStream stream, const RawLayout& layout, std::vector<std::uint8_t> bytes) {
  const auto view = std::as_bytes(std::span{bytes});
  return {.stream = stream,
          .encoding = ImageEncoding::kRaw,
          .raw = layout,
          .bytes = {view.begin(), view.end()},
          .origin = "message 3"};
}

TEST_F(Decode, CopiesRawDepthOfBothByteOrdersAndPaddedRows) {
  const ImageShape shape{.width = 2, .height = 2, .format = PixelFormat::kDepth16};
  const auto little = decode_with(
      raw(ImageStream::kDepth, {.shape = shape, .step_bytes = 5}, {1, 2, 3, 4, 99, 5, 6, 7, 8}));
  ASSERT_TRUE(little) << little.error().message;
  EXPECT_EQ(little->row<std::uint16_t>(0)[0], 0x0201);
  EXPECT_EQ(little->row<std::uint16_t>(1)[1], 0x0807);
  const auto big =
      decode_with(raw(ImageStream::kDepth, {.shape = shape, .step_bytes = 4, .big_endian = true},
                      {1, 2, 3, 4, 5, 6, 7, 8}));
  ASSERT_TRUE(big);
  EXPECT_EQ(big->row<std::uint16_t>(0)[0], 0x0102);
}

TEST_F(Decode, TurnsMetresIntoCounts) {
  const std::vector<float> metres = {1.5F, 0.0F,   -1.0F, std::numeric_limits<float>::quiet_NaN(),
                                     1e9F, 0.0104F};
  std::vector<std::uint8_t> bytes(metres.size() * sizeof(float));
  std::memcpy(bytes.data(), metres.data(), bytes.size());
  const RawLayout layout{.shape = {.width = 6, .height = 1, .format = PixelFormat::kDepth16},
                         .step_bytes = bytes.size(),
                         .metres_f32 = true};
  const auto frame = decode_with(raw(ImageStream::kDepth, layout, bytes));
  ASSERT_TRUE(frame) << frame.error().message;
  const auto* row = frame->row<std::uint16_t>(0);
  EXPECT_THAT(std::vector<int>(row, row + 6), testing::ElementsAre(1500, 0, 0, 0, 0, 10));
}

TEST_F(Decode, ConvertsRawColor) {
  const RawLayout layout{.shape = {.width = 1, .height = 1, .format = PixelFormat::kRgb8},
                         .step_bytes = 3};
  const auto image = raw(ImageStream::kColor, layout, {10, 20, 30});
  const auto bgr = decode_with(image);
  const auto gray = decode_with(image, {.color_as_gray = true});
  ASSERT_TRUE(bgr && gray);
  EXPECT_EQ(bgr->row<std::uint8_t>(0)[0], 30);
  EXPECT_EQ(bgr->row<std::uint8_t>(0)[2], 10);
  EXPECT_EQ(gray->row<std::uint8_t>(0)[0], 18);  // 0.299 * 10 + 0.587 * 20 + 0.114 * 30
}

TEST_F(Decode, RefusesRawImagesThatAreTooShort) {
  const ImageShape shape{.width = 2, .height = 2, .format = PixelFormat::kDepth16};
  const std::vector<std::uint8_t> bytes(7);
  EXPECT_THAT(
      message_of(decode_with(raw(ImageStream::kDepth, {.shape = shape, .step_bytes = 4}, bytes))),
      AllOf(HasSubstr("message 3"), HasSubstr("too few")));
  EXPECT_FALSE(decode_with(raw(ImageStream::kDepth, {.shape = shape, .step_bytes = 0}, bytes)));
  EXPECT_FALSE(decode_with(
      raw(ImageStream::kDepth, {.shape = shape, .step_bytes = ~std::size_t{0}}, bytes)));
  EXPECT_FALSE(decode_with(raw(ImageStream::kColor, {.shape = shape, .step_bytes = 2}, bytes)));
  EXPECT_FALSE(decode_with(
      raw(ImageStream::kDepth,
          {.shape = {.width = -1, .height = 2, .format = PixelFormat::kDepth16}}, bytes)));
}

}  // namespace
}  // namespace geoflow::drivers
