#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "replay/oni/depth_codec.hpp"
#include "replay/oni/structure.hpp"
#include "replay/oni_file.hpp"

namespace geoflow::drivers::tests {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) {
    bytes.push_back(static_cast<std::byte>(value));
  }
  return bytes;
}

TEST(OniDepth, DifferencesEscapesAndRepetitionsAreUndone) {
  // 1000; half bytes 6-5 = +1 and 6-8 = -2; half byte 0 with a byte 192-130 = +62; an escaped
  // value of 15 bits; twice two repetitions; a single half byte (the second one is 0xd).
  const auto depth = oni::decode_depth(
      bytes_of({0xe8, 3, 0x58, 0x6f, 130, 0xff, 0x12, 0x34, 0xe2, 0x0d}), false, 11);
  ASSERT_TRUE(depth) << depth.error().message;
  EXPECT_THAT(*depth, ElementsAre(1000, 1001, 999, 999, 1061, 0x1234, 0x1234, 0x1234, 0x1234,
                                  0x1234, 0x1234 + 6));
}

TEST(OniDepth, IndicesOfATableAreLookedUp) {
  const auto depth =
      oni::decode_depth(bytes_of({3, 0, 0, 0, 0xe8, 3, 0xd0, 7, 0, 0, 0x55, 0x8d}), true, 4);
  ASSERT_TRUE(depth) << depth.error().message;
  EXPECT_THAT(*depth, ElementsAre(0, 1000, 2000, 0));
}

TEST(OniDepth, WhatCannotBeIsAnError) {
  const auto error = [](std::initializer_list<int> bytes, bool with_table, std::size_t pixels) {
    const auto depth = oni::decode_depth(bytes_of(bytes), with_table, pixels);
    return depth ? std::string{} : depth.error().message;
  };
  EXPECT_THAT(error({}, false, 1), HasSubstr("cut off"));
  EXPECT_THAT(error({1, 0, 0xff}, false, 2), HasSubstr("cut off"));
  EXPECT_THAT(error({1, 0}, false, 2), HasSubstr("1 pixels where 2 belong"));
  EXPECT_THAT(error({1, 0, 0xef}, false, 2), HasSubstr("more than 2 pixels"));
  EXPECT_THAT(error({1, 0, 7, 0, 1, 0}, true, 1), HasSubstr("outside its table"));
  EXPECT_THAT(error({0xff, 0xff, 7, 0}, true, 1), HasSubstr("cut off"));
}

class OniRecording : public testing::Test {
 protected:
  class Sink final : public CameraSink {
   public:
    void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
      color.push_back(frame);
    }
    void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
      depth.push_back(frame);
    }
    std::vector<Arrival<CameraClock, ColorFrame>> color;
    std::vector<Arrival<CameraClock, DepthFrame>> depth;
  };

  [[nodiscard]] auto open(const std::string& bytes) const {
    std::ofstream{path_, std::ios::binary} << bytes;
    return RecordedStreams::open({.path = path_});
  }
  [[nodiscard]] std::string error(const std::string& bytes) const {
    const auto streams = open(bytes);
    return streams ? std::string{} : streams.error().message;
  }

  geoflow::tests::TemporaryDirectory folder_;
  std::filesystem::path path_ = folder_.path() / "walk.oni";
};

TEST_F(OniRecording, GivesItsFramesAndItsFieldsOfView) {
  auto streams = open(small_oni_file().bytes());
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ((*streams)->info().format, "oni");
  const auto& camera = (*streams)->calibration().camera;
  EXPECT_EQ(camera.width, 2);
  EXPECT_NEAR(camera.fx, 1 / std::tan(0.5), 1e-9);
  EXPECT_NEAR(camera.fy, 0.5 / std::tan(0.375), 1e-9);
  EXPECT_EQ(camera.cx, 0.5);
  Sink sink;
  ASSERT_TRUE((*streams)->camera().start(sink));
  for (auto more = (*streams)->step(); more && *more; more = (*streams)->step()) {
  }
  ASSERT_EQ(sink.depth.size(), 2U);
  ASSERT_EQ(sink.color.size(), 2U);
  const auto* const depth = sink.depth[1].sample.image.row<std::uint16_t>(0);
  EXPECT_EQ(depth[0], 1000);
  EXPECT_EQ(depth[1], 2000);
  const auto* const color = sink.color[1].sample.image.row<std::uint8_t>(0);
  EXPECT_THAT(std::vector<int>(color, color + 6), ElementsAre(0, 0, 255, 255, 0, 0));
  EXPECT_EQ(sink.depth[1].t_device - sink.depth[0].t_device, std::chrono::microseconds{33'333});
}

TEST_F(OniRecording, ThatIsCutOffGivesWhatItHas) {
  constexpr std::size_t kEndRecordBytes = 28;
  const std::string whole = small_oni_file().bytes();
  struct Case {
    std::size_t missing;
    int frames;
  };
  // Without the record that ends it; in the middle of that record; and of the last frame.
  for (const Case& cut : {Case{kEndRecordBytes, 4}, Case{10, 4}, Case{kEndRecordBytes + 2, 3}}) {
    auto streams = open(whole.substr(0, whole.size() - cut.missing));
    ASSERT_TRUE(streams) << streams.error().message;
    int frames = 0;
    std::vector<std::string> errors;
    Sink sink;
    ASSERT_TRUE((*streams)->camera().start(sink));
    for (auto more = (*streams)->step(); !more || *more; more = (*streams)->step()) {
      frames += more ? 1 : 0;
      if (!more) {
        errors.push_back(more.error().message);
      }
    }
    EXPECT_EQ(frames, cut.frames);
    EXPECT_THAT(errors, ElementsAre(HasSubstr(fmt::format("after {} frames", cut.frames))));
    EXPECT_EQ((*streams)->camera().health().state, SourceState::kFailed);
    EXPECT_THAT(oni::check_structure(path_).error().message, HasSubstr("is cut off at byte"));
  }
}

TEST_F(OniRecording, ThatIsDamagedSaysWhere) {
  const std::string whole = small_oni_file().bytes();
  std::string wrong = whole;
  wrong[24] = 'X';
  EXPECT_THAT(error(wrong), HasSubstr("walk.oni: byte 24: here should be a record"));
  wrong = whole;
  wrong.replace(36, 4, "\xff\xff\xff\x7f");  // the first record's length
  EXPECT_THAT(error(wrong), HasSubstr("longer than any"));
  EXPECT_THAT(error(OniFile{}.bytes()), HasSubstr("has no colour stream"));
}

TEST_F(OniRecording, ThatIsOfAnotherKindIsRefused) {
  const auto with = [](std::string_view depth_codec, std::uint64_t color_format,
                       std::uint32_t width) {
    OniFile file;
    file.add_node(1, 2, depth_codec).add_size(1, 2, 1);
    file.add_node(2, 3, "NONE").add_size(2, width, 1).add_pixel_format(2, color_format);
    return file.add_frame(1, 0, {}).end().bytes();
  };
  EXPECT_THAT(error(with("abcd", 200, 2)), HasSubstr("unknown codec"));
  EXPECT_THAT(error(with("16zT", 203, 2)), HasSubstr("unknown pixels (203)"));
  EXPECT_THAT(error(with("16zT", 200, 4)), HasSubstr("colour is 4x1, depth 2x1"));
  EXPECT_THAT(error(with("16zT", 200, 9000)), HasSubstr("no size that an image can have"));
}

TEST_F(OniRecording, IsCheckedBeforeOpenNiGetsIt) {
  std::ofstream{path_, std::ios::binary} << small_oni_file().bytes();
  EXPECT_TRUE(oni::check_structure(path_));
  std::ofstream{path_, std::ios::binary} << OniFile{}.end().bytes();
  EXPECT_THAT(oni::check_structure(path_).error().message, HasSubstr("has no whole frame"));
}

}  // namespace
}  // namespace geoflow::drivers::tests
