#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "can/bus_fixture.hpp"
#include "can/candump.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers {
namespace {

using testing::HasSubstr;

constexpr HostTime kBegin{std::chrono::seconds{1'700'000'000}};
constexpr std::uint64_t kRounds = 300;

/// Keeps what comes.
class LegRecorder final : public LegSink {
 public:
  void on_legs(const Arrival<LegClock, LegSample>& sample) override { samples.push_back(sample); }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
  std::vector<Arrival<LegClock, LegSample>> samples;
};

std::string log_of(const std::vector<can::Received>& frames) {
  std::string text;
  for (const can::Received& received : frames) {
    text += can::format_log_line(received.t_arrival.time_since_epoch(), "can0", received.frame);
    text += '\n';
  }
  return text;
}

std::filesystem::path write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream{file} << text;
  return file;
}

/// All samples of a recording, and the texts of what was rejected.
struct Replayed {
  std::vector<Arrival<LegClock, LegSample>> samples;
  std::vector<std::string> errors;
};

Replayed replay(RecordedStreams& streams) {
  Replayed replayed;
  LegRecorder recorder;
  EXPECT_TRUE(streams.legs()->start(recorder));
  bool more = true;
  while (more) {
    const auto stepped = streams.step();
    if (!stepped) {
      replayed.errors.push_back(stepped.error().message);
    }
    more = stepped.value_or(true);
  }
  streams.legs()->stop();
  replayed.samples = std::move(recorder.samples);
  return replayed;
}

TEST(CanLog, IsARecordingOfLegs) {
  const tests::TemporaryDirectory directory;
  const auto log = write(directory.path() / "walk.log",
                         log_of(can::tests::rounds(1000, kRounds, kBegin)) + "(1.0) nonsense\n");
  auto streams = RecordedStreams::open({.path = log});
  ASSERT_TRUE(streams) << streams.error().message;
  const RecordingInfo& info = (*streams)->info();
  EXPECT_EQ(info.format, "candump");
  ASSERT_EQ(info.streams.size(), 1U);
  EXPECT_EQ(info.streams[0].count, kRounds);
  EXPECT_EQ(info.start, kBegin);
  EXPECT_EQ(info.end, kBegin + (kRounds - 1) * can::tests::kRoundPeriod);
  ASSERT_NE((*streams)->legs(), nullptr);
  EXPECT_EQ((*streams)->legs()->stamps().domain, StampDomain::kDevice);
  const Replayed replayed = replay(**streams);
  ASSERT_EQ(replayed.samples.size(), kRounds);
  for (std::uint64_t i = 0; i < kRounds; ++i) {
    EXPECT_TRUE(can::tests::is_same(replayed.samples[i].sample, can::tests::sample_of(1000 + i)));
  }
  EXPECT_THAT(replayed.errors, testing::ElementsAre(HasSubstr("walk.log:3901: 2 fields where 3")));
}

TEST(CanLog, TheDictionaryBesideItIsTaken) {
  const tests::TemporaryDirectory directory;
  const auto log = write(directory.path() / "walk.log", "(100.0) can0 000#017FFF7FF7FF\n");
  EXPECT_THAT(
      RecordedStreams::open({.path = log}).error().message,
      HasSubstr("walk.log: by the dictionary config/go2_legs.dbc no frame there is of a leg"));
  std::string text;
  for (int i = 0; i < 36; ++i) {
    can::Frame reply = can::tests::frame("000#017FFF7FF7FF");
    reply.data[0] = static_cast<std::byte>(i % 12 + 1);
    text += can::format_log_line(std::chrono::milliseconds{100'000 + i}, "can0", reply) + "\n";
  }
  write(log, text);
  std::filesystem::copy_file(GEOFLOW_CONFIG_FOLDER "/mit_actuators.dbc",
                             directory.path() / "mine.dbc");
  auto streams = RecordedStreams::open({.path = log});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ(replay(**streams).samples.size(), 3U);
  // One that is named is taken before it.
  EXPECT_FALSE(RecordedStreams::open(
      {.path = log, .can_dictionary = GEOFLOW_CONFIG_FOLDER "/go2_legs.dbc"}));
}

}  // namespace
}  // namespace geoflow::drivers
