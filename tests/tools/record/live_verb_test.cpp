#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"

namespace geoflow::tools {
namespace {

using geoflow::tests::Process;
using geoflow::tests::run_process;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

/// A robot on a DDS domain of this process's own, on the loopback interface: 500 messages a second
/// whose first joint's angle counts them.
class TalkingRobot {
 public:
  explicit TalkingRobot(std::unique_ptr<drivers::LegEmitter> emitter)
      : emitter_{std::move(emitter)},
        thread_{[this](const std::stop_token& stop) { talk(stop); }} {}

 private:
  void talk(const std::stop_token& stop) {
    HostTime due = HostClock::now();
    for (int i = 0; !stop.stop_requested(); ++i) {
      drivers::EmittedSample sample;
      sample.device_time = milliseconds{2} * i;
      sample.legs.joints[0].q_rad = 1e-3 * i;
      sample.legs.valid.fill(true);
      (void)emitter_->emit(sample);
      due += milliseconds{2};
      std::this_thread::sleep_until(due);
    }
  }

  std::unique_ptr<drivers::LegEmitter> emitter_;
  std::jthread thread_;
};

class LiveVerb : public testing::Test {
 protected:
  void SetUp() override {
    auto emitter = drivers::open_dds_emitter({.interface = "lo", .domain = domain_});
    if (!emitter && emitter.error().code == ErrorCode::kUnsupported) {
      GTEST_SKIP() << emitter.error().message;
    }
    ASSERT_TRUE(emitter) << emitter.error().message;
    robot_.emplace(std::move(*emitter));
  }
  [[nodiscard]] std::vector<std::string> record_legs() const {
    return {GEOFLOW_PROGRAM,
            "record",
            "--live",
            "--set",
            "source.legs=dds",
            "--set",
            "dds.interface=lo",
            "--set",
            fmt::format("dds.domain={}", domain_),
            "-o",
            bag_.string(),
            "--json"};
  }
  [[nodiscard]] std::filesystem::path log() const { return folder_.path() / "log"; }
  [[nodiscard]] std::filesystem::path database() const { return bag_ / "bag_0.db3"; }

  /// Waits until something has been committed to the bag.
  void wait_for_samples() const {
    const HostTime limit = HostClock::now() + seconds{60};
    const auto wal = std::filesystem::path{database()} += "-wal";
    std::error_code error;
    // A second of messages, after which they are committed, is half of that.
    constexpr std::uintmax_t kSomeMessages = 1'000'000;
    while (HostClock::now() < limit && !(std::filesystem::exists(wal, error) &&
                                         std::filesystem::file_size(wal, error) > kSomeMessages)) {
      std::this_thread::sleep_for(milliseconds{20});
    }
  }

  /// Reads the bag to its end: whole messages only, in their order.
  [[nodiscard]] std::uint64_t count_legs() const {
    class Legs final : public LegSink {
     public:
      void on_legs(const Arrival<LegClock, LegSample>& sample) override {
        const double q_rad = sample.sample.joints[0].q_rad;
        if (last) {
          EXPECT_GT(q_rad, *last);
        }
        last = q_rad;
        ++count;
      }
      void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
      std::optional<double> last;
      std::uint64_t count = 0;
    } legs;
    auto streams = drivers::RecordedStreams::open({.path = bag_});
    EXPECT_TRUE(streams) << (streams ? "" : streams.error().message);
    if (!streams || (*streams)->legs() == nullptr || !(*streams)->legs()->start(legs)) {
      return 0;
    }
    for (auto more = (*streams)->step(); more && *more; more = (*streams)->step()) {
    }
    (*streams)->legs()->stop();
    return legs.count;
  }

  geoflow::tests::TemporaryDirectory folder_;
  std::filesystem::path bag_ = folder_.path() / "bag";
  int domain_ = static_cast<int>(10 + ::getpid() % 200);
  std::optional<TalkingRobot> robot_;
};

TEST_F(LiveVerb, RecordsForTheTimeThatWasAskedFor) {
  auto arguments = record_legs();
  arguments.insert(arguments.end(), {"--duration", "4"});
  const auto done = run_process(arguments, log());
  ASSERT_EQ(done.code, 0) << done.err;
  const auto report = nlohmann::json::parse(done.out);
  EXPECT_EQ(report["dropped"], 0);
  EXPECT_GT(report["streams"]["legs"], 500);
  EXPECT_EQ(report["streams"]["legs"], count_legs());
}

TEST_F(LiveVerb, EndsInOrderOnSigint) {
  Process process{record_legs(), log()};
  wait_for_samples();
  process.send_signal(SIGINT);
  ASSERT_EQ(process.wait(seconds{60}), 0) << process.err();
  EXPECT_TRUE(std::filesystem::exists(bag_ / "metadata.yaml"));
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::path{database()} += "-wal"));
  const auto report = nlohmann::json::parse(process.out());
  EXPECT_EQ(report["interrupted"], true);
  EXPECT_EQ(report["streams"]["legs"], count_legs());
}

TEST_F(LiveVerb, LeavesAWholeBagWhenItIsKilled) {
  Process process{record_legs(), log()};
  wait_for_samples();
  process.send_signal(SIGKILL);
  ASSERT_EQ(process.wait(seconds{60}), 128 + SIGKILL);
  EXPECT_FALSE(std::filesystem::exists(bag_ / "metadata.yaml"));
  EXPECT_GT(count_legs(), 400U);
}

TEST(LiveVerbErrors, SayWhatIsMissing) {
  const geoflow::tests::TemporaryDirectory folder;
  const auto record = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments{GEOFLOW_PROGRAM, "record", "-o",
                                       (folder.path() / "bag").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_process(arguments, folder.path() / "log");
  };
  EXPECT_THAT(record({}).err, HasSubstr("one of --from RECORDING and --live"));
  EXPECT_THAT(record({"--live"}).err, HasSubstr("no device is named"));
  EXPECT_EQ(record({"--live"}).code, 2);
  EXPECT_EQ(record({"--live", "--from", "x"}).code, 2);
  EXPECT_EQ(record({"--from", "x", "--duration", "3"}).code, 2);
  const auto lost = record({"--live", "--set", "source.camera=d435i", "--set", "d435i.serial='0'"});
  EXPECT_THAT(lost.err, HasSubstr("no D435i with the serial number 0 is connected"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "bag"));
}

}  // namespace
}  // namespace geoflow::tools
