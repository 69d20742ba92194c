#include <algorithm>
#include <cstddef>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "tests/support/data.hpp"

#include "replay/fixtures.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::message_of;

TEST(FaultsInAReplay, AreCountedInAReplay) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 10);
  const auto script = directory.path() / "faults.toml";
  tests::write_text(script,
                    "[[fault]]\nkind = 'truncate'\nstream = 'color'\nuntil_s = 0.03\n"
                    "[[fault]]\nkind = 'drop'\nstream = 'depth'\nfrom_s = 0.3\n"
                    "[[fault]]\nkind = 'clock_wrap'\nstream = 'camera'\nfirst_wrap_s = 0.1\n");
  auto streams = RecordedStreams::open({.path = directory.path(), .faults = script});
  ASSERT_TRUE(streams) << streams.error().message;
  tests::Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_EQ((*streams)->camera().stamps().domain, StampDomain::kDevice);
  EXPECT_THAT(tests::drain(**streams),
              ElementsAre(AllOf(HasSubstr("rgb.txt:3"), HasSubstr("cut off"))));
  const FaultCounters counters = (*streams)->faults();
  EXPECT_EQ(counters.of(FaultKind::kTruncate, StreamId::kColor), 1U);
  EXPECT_EQ(counters.of(FaultKind::kDrop, StreamId::kDepth), 1U);
  EXPECT_EQ(counters.of(FaultKind::kClockWrap, StreamId::kColor) +
                counters.of(FaultKind::kClockWrap, StreamId::kDepth),
            1U);
  EXPECT_EQ(recorder.colors.size(), 9U);
  EXPECT_EQ(recorder.depths.size(), 9U);
  EXPECT_THAT(message_of(RecordedStreams::open(
                  {.path = directory.path(), .faults = directory.path() / "none.toml"})),
              HasSubstr("none.toml"));
}

TEST(FaultsInAReplay, ACoveredLensSeesBlackAndNoDepth) {
  const TemporaryDirectory directory;
  tests::write_tum(directory.path(), 10);
  const auto script = directory.path() / "faults.toml";
  tests::write_text(script, "[[fault]]\nkind = 'cover'\nstream = 'camera'\nuntil_s = 0.03\n");
  auto streams = RecordedStreams::open({.path = directory.path(), .faults = script});
  ASSERT_TRUE(streams) << streams.error().message;
  tests::Recorder recorder;
  ASSERT_TRUE((*streams)->camera().start(recorder));
  EXPECT_THAT(tests::drain(**streams), testing::IsEmpty());
  EXPECT_EQ((*streams)->faults().of(FaultKind::kCover, StreamId::kColor), 1U);
  EXPECT_EQ((*streams)->faults().of(FaultKind::kCover, StreamId::kDepth), 1U);
  const auto dark = [](const FrameRef& image) {
    return std::ranges::all_of(image.bytes(), [](std::byte byte) { return byte == std::byte{0}; });
  };
  ASSERT_EQ(recorder.colors.size(), 10U);
  ASSERT_EQ(recorder.depths.size(), 10U);
  EXPECT_EQ(recorder.colors[0].sample.image.shape(), recorder.colors[1].sample.image.shape());
  EXPECT_EQ(recorder.depths[0].sample.image.shape(), recorder.depths[1].sample.image.shape());
  EXPECT_TRUE(dark(recorder.colors[0].sample.image));
  EXPECT_TRUE(dark(recorder.depths[0].sample.image));
  EXPECT_FALSE(dark(recorder.colors[1].sample.image));
  EXPECT_FALSE(dark(recorder.depths[1].sample.image));
}

TEST(FaultsInAReplay, KitchenWithEveryFaultReachesItsEnd) {
  GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
  const TemporaryDirectory directory;
  const auto script = directory.path() / "faults.toml";
  tests::write_text(script,
                    "[[fault]]\nkind = 'gap'\nstream = 'camera'\nfrom_s = 5\nuntil_s = 6\n"
                    "[[fault]]\nkind = 'drop'\nstream = 'camera'\nprobability = 0.2\n"
                    "[[fault]]\nkind = 'reorder'\nstream = 'depth'\nprobability = 0.1\n"
                    "[[fault]]\nkind = 'duplicate'\nstream = 'camera'\nprobability = 0.05\n"
                    "[[fault]]\nkind = 'truncate'\nstream = 'camera'\nprobability = 0.05\n"
                    "[[fault]]\nkind = 'clock_wrap'\nstream = 'camera'\nfirst_wrap_s = 4\n");
  auto streams = RecordedStreams::open(
      {.path = path, .faults = script, .fault_seed = 3, .color_as_gray = true});
  ASSERT_TRUE(streams) << streams.error().message;
  const auto errors = tests::drain(**streams);
  const FaultCounters counters = (*streams)->faults();
  const auto truncated = counters.of(FaultKind::kTruncate, StreamId::kColor) +
                         counters.of(FaultKind::kTruncate, StreamId::kDepth);
  EXPECT_GT(truncated, 10U);
  EXPECT_EQ(errors.size(), truncated);
  EXPECT_EQ(counters.of(FaultKind::kClockWrap, StreamId::kColor) +
                counters.of(FaultKind::kClockWrap, StreamId::kDepth),
            1U);
}

}  // namespace
}  // namespace geoflow::drivers
