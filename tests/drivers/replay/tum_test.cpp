#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

#include "replay/fixtures.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::drain;
using tests::message_of;
using tests::Recorder;

TEST(Tum, DeliversBothStreamsInOrderOfTime) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 3);
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre());
  EXPECT_EQ(recorder.order, "cdcdcd");
  EXPECT_EQ(recorder.arrivals.front(), tests::at_ms(100000));
  EXPECT_EQ(recorder.depths.back().sample.image.row<std::uint16_t>(5)[7], 2);
  EXPECT_EQ(recorder.depths.back().t_device.time_since_epoch(),
            recorder.depths.back().t_arrival.time_since_epoch());
  EXPECT_EQ((*streams)->info().format, "tum");
  EXPECT_EQ((*streams)->info().streams.at(0).count, 3U);
  EXPECT_EQ((*streams)->imu(), nullptr);
  EXPECT_EQ((*streams)->legs(), nullptr);
}

TEST(Tum, SortsListsThatAreOutOfOrder) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 3);
  tests::write_text(directory.path() / "rgb.txt",
                    "100.2 rgb/2.png\n100.0 rgb/0.png\n100.1 rgb/1.png\n");
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams);
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  drain(**streams);
  EXPECT_TRUE(std::ranges::is_sorted(recorder.arrivals));
  EXPECT_EQ(recorder.colors.size(), 3U);
}

TEST(Tum, ReadsAssociationsWhereThereAreNoLists) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 2);
  std::filesystem::remove(directory.path() / "rgb.txt");
  tests::write_text(directory.path() / "associations.txt",
                    "100.0 depth/0.png 100.01 rgb/0.png\r\n100.1 depth/1.png 100.11 rgb/1.png\r\n");
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre());
  EXPECT_EQ(recorder.order, "dcdc");
}

TEST(Tum, NamesTheFirstMissingImageAndHowManyThereAre) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 5);
  std::filesystem::remove(directory.path() / "rgb/2.png");
  std::filesystem::remove(directory.path() / "rgb/4.png");
  const auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_FALSE(streams);
  EXPECT_EQ(streams.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(streams.error().message, AllOf(HasSubstr("rgb.txt:5: rgb/2.png: no such file"),
                                             HasSubstr("2 of the 10 listed files missing")));
}

TEST(Tum, GarbageInAListIsAnErrorWithItsLine) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 2);
  tests::write_text(directory.path() / "depth.txt",
                    "# depth\n100.0 depth/0.png\nlorem ipsum dolor sit\n");
  EXPECT_THAT(message_of(RecordedStreams::open({.path = directory.path()})),
              AllOf(HasSubstr(directory.path().string()), HasSubstr("depth.txt:3")));
  tests::write_text(directory.path() / "depth.txt", "");
  tests::write_text(directory.path() / "rgb.txt", "# nothing\n");
  EXPECT_THAT(message_of(RecordedStreams::open({.path = directory.path()})),
              HasSubstr("name no image"));
}

TEST(Tum, GoesOnBehindImagesThatCannotBeDecoded) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 4);
  tests::write_depth(directory.path() / "depth/1.png", 9, tests::kWidth / 2, tests::kHeight);
  tests::write_color(directory.path() / "depth/2.png", 9);
  tests::write_text(directory.path() / "rgb/3.png", "not an image");
  auto streams = RecordedStreams::open({.path = directory.path()});
  ASSERT_TRUE(streams);
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(
      drain(**streams),
      ElementsAre(AllOf(HasSubstr("depth.txt:3: depth/1.png"), HasSubstr("16 x 24 pixels")),
                  AllOf(HasSubstr("depth.txt:4: depth/2.png"), HasSubstr("8 bits in colour")),
                  AllOf(HasSubstr("rgb.txt:6: rgb/3.png"), HasSubstr("neither a PNG nor a JPEG"))));
  EXPECT_EQ(recorder.order, "cdccd");
  EXPECT_EQ((*streams)->camera().health().rejected, 3U);
  EXPECT_EQ((*streams)->camera().health().delivered, 5U);
  EXPECT_EQ((*streams)->recent_errors().size(), 3U);
}

TEST(Tum, ReadsARealSenseRecordingWithoutRegistration) {
  GEOFLOW_DATA_OR_SKIP(source, "d435-floor");
  const TemporaryDirectory directory;
  std::string rgb;
  std::string depth;
  for (const auto& entry : std::filesystem::directory_iterator{source / "depth"}) {
    const std::string stem = entry.path().stem().string();
    depth += fmt::format("1{}.0 {}\n", stem, entry.path().string());
  }
  for (const auto& entry : std::filesystem::directory_iterator{source / "rgb"}) {
    rgb += fmt::format("1{}.0 {}\n", entry.path().stem().string(), entry.path().string());
  }
  tests::write_text(directory.path() / "rgb.txt", rgb);
  tests::write_text(directory.path() / "depth.txt", depth);
  auto streams = RecordedStreams::open({.path = directory.path(), .calibration = source});
  ASSERT_TRUE(streams) << streams.error().message;
  Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(drain(**streams), ElementsAre());
  EXPECT_EQ(recorder.depths.size(), 60U);
  EXPECT_DOUBLE_EQ((*streams)->calibration().depth_unit_m, 1e-3);
}

}  // namespace
}  // namespace geoflow::drivers
