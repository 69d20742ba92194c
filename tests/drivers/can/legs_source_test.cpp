#include "can/legs_source.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "can/bus_fixture.hpp"
#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers::can {
namespace {

using testing::HasSubstr;
using tests::rounds;

/// What the test and the source's thread share of a bus.
struct Script {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<Received> frames;
  std::optional<Error> failure;  // of open() and read(), while it is there
  std::uint64_t overflowed = 0;
  std::uint64_t opened = 0;
  Listen listening = Listen::kToKnown;
  bool woken = false;
};

/// A bus on which comes what the test says.
class ScriptedChannel final : public Channel {
 public:
  explicit ScriptedChannel(std::shared_ptr<Script> script) : script_{std::move(script)} {}

  Result<void> open() override {
    const std::scoped_lock lock{script_->mutex};
    ++script_->opened;
    return script_->failure ? Result<void>{tl::unexpected{*script_->failure}} : Result<void>{};
  }
  Result<void> read(std::vector<Received>& frames, Duration timeout) override {
    std::unique_lock lock{script_->mutex};
    wait(lock, timeout);
    if (script_->failure) {
      return tl::unexpected{*script_->failure};
    }
    frames.insert(frames.end(), script_->frames.begin(), script_->frames.end());
    script_->frames.clear();
    return {};
  }
  void listen(Listen to) override {
    const std::scoped_lock lock{script_->mutex};
    script_->listening = to;
  }
  [[nodiscard]] std::uint64_t overflowed() const override {
    const std::scoped_lock lock{script_->mutex};
    return script_->overflowed;
  }
  void pause(Duration timeout) override {
    std::unique_lock lock{script_->mutex};
    wait(lock, timeout);
  }
  void wake() noexcept override {
    const std::scoped_lock lock{script_->mutex};
    script_->woken = true;
    script_->changed.notify_all();
  }

 private:
  void wait(std::unique_lock<std::mutex>& lock, Duration timeout) {
    script_->changed.wait_for(lock, timeout,
                              [this] { return script_->woken || !script_->frames.empty(); });
    script_->woken = false;
  }
  std::shared_ptr<Script> script_;
};

class CountingSink final : public LegSink {
 public:
  void on_legs(const Arrival<LegClock, LegSample>& sample) override {
    in_order = in_order && sample.t_arrival >= last_;
    last_ = sample.t_arrival;
    count.fetch_add(1);
  }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
  std::atomic<std::uint64_t> count{0};
  std::atomic<bool> in_order{true};

 private:
  HostTime last_;
};

class LegsSourceTest : public testing::Test {
 protected:
  void send(std::uint64_t first, std::uint64_t count) {
    add(rounds(first, count, HostClock::now()));
  }
  void add(const std::vector<Received>& frames) {
    const std::scoped_lock lock{script_->mutex};
    script_->frames.insert(script_->frames.end(), frames.begin(), frames.end());
    script_->changed.notify_all();
  }
  void fail_with(std::optional<Error> error) {
    const std::scoped_lock lock{script_->mutex};
    script_->failure = std::move(error);
  }
  /// Whether it comes true before a machine that is busy would be patient no more.
  template <typename Condition>
  static bool eventually(const Condition& condition) {
    const HostTime end = HostClock::now() + std::chrono::seconds{20};
    while (!condition() && HostClock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds{2});
    }
    return condition();
  }
  bool reason_becomes(const std::string& text) {
    return eventually([&] { return source_.health().reason.find(text) != std::string::npos; });
  }

  std::shared_ptr<Script> script_ = std::make_shared<Script>();
  LegsSource source_{
      LegDictionary::load({}).value(), std::make_unique<ScriptedChannel>(script_), {"can0"}};
  CountingSink sink_;
};

TEST_F(LegsSourceTest, SnapshotsComeAndAreCounted) {
  EXPECT_EQ(source_.health().state, SourceState::kStopped);
  ASSERT_TRUE(source_.start(sink_));
  EXPECT_FALSE(source_.start(sink_));
  EXPECT_EQ(source_.stamps().domain, StampDomain::kDevice);
  send(0, 200);
  EXPECT_TRUE(eventually([&] { return sink_.count == 200; })) << sink_.count;
  EXPECT_TRUE(eventually([&] { return source_.health().delivered == 200; }));
  EXPECT_TRUE(sink_.in_order);
  source_.stop();
  EXPECT_EQ(source_.health().state, SourceState::kStopped);
  send(200, 10);
  EXPECT_EQ(sink_.count, 200U);
  // It can be started again.
  ASSERT_TRUE(source_.start(sink_));
  EXPECT_TRUE(eventually([&] { return sink_.count >= 209; })) << sink_.count;
}

TEST_F(LegsSourceTest, ABusThatIsDownIsOpenedAgainUntilItWorks) {
  fail_with(Error{.code = ErrorCode::kUnavailable, .message = "can0: is down"});
  ASSERT_TRUE(source_.start(sink_));
  ASSERT_TRUE(reason_becomes("can0: is down"));
  EXPECT_EQ(source_.health().state, SourceState::kFailed);
  fail_with(std::nullopt);
  send(0, 50);
  EXPECT_TRUE(eventually([&] { return sink_.count == 50; })) << sink_.count;
  fail_with(Error{.code = ErrorCode::kUnavailable, .message = "can0: Network is down"});
  ASSERT_TRUE(reason_becomes("can0: Network is down"));
  fail_with(std::nullopt);
  send(50, 50);
  EXPECT_TRUE(eventually([&] { return sink_.count == 100; })) << sink_.count;
  const std::scoped_lock lock{script_->mutex};
  EXPECT_GE(script_->opened, 3U);
}

TEST_F(LegsSourceTest, InSilenceItListensToAllAndSaysWhatItHears) {
  ASSERT_TRUE(source_.start(sink_));
  ASSERT_TRUE(reason_becomes("can0: nothing comes"));
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock{script_->mutex};
    return script_->listening == Listen::kToAll;
  }));
  add({{.frame = tests::frame("7E8#00"), .t_arrival = HostClock::now()}});
  EXPECT_TRUE(reason_becomes("frames come (0x7E8)"));
  send(0, 50);
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock{script_->mutex};
    return script_->listening == Listen::kToKnown || source_.health().reason.empty();
  }));
}

TEST_F(LegsSourceTest, DroppedFramesAreInItsHealth) {
  ASSERT_TRUE(source_.start(sink_));
  {
    const std::scoped_lock lock{script_->mutex};
    script_->overflowed = 17;
  }
  send(0, 20);
  EXPECT_TRUE(eventually([&] { return source_.health().dropped == 17; }));
}

TEST(CanLegs, WhatIsReadIsLoggedAsCandumpDoes) {
  const geoflow::tests::TemporaryDirectory directory;
  const auto file = directory.path() / "walk.log";
  auto script = std::make_shared<Script>();
  script->frames = rounds(7, 100, HostClock::now());
  CountingSink sink;
  {
    LegsSource source{LegDictionary::load({}).value(),
                      std::make_unique<ScriptedChannel>(script),
                      {"can0"},
                      std::ofstream{file}};
    ASSERT_TRUE(source.start(sink));
    const HostTime end = HostClock::now() + std::chrono::seconds{20};
    while (sink.count < 100 && HostClock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds{2});
    }
  }
  EXPECT_EQ(sink.count, 100U);
  const auto streams = RecordedStreams::open({.path = file});
  ASSERT_TRUE(streams) << streams.error().message;
  EXPECT_EQ((*streams)->info().streams[0].count, 100U);
}

TEST(CanLegs, WrongOptionsAreErrors) {
  EXPECT_THAT(open_can_legs({.interfaces = "can0,,can1"}).error().message, HasSubstr("no names"));
  EXPECT_EQ(open_can_legs({.dictionary = "/nonexistent.dbc"}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(open_can_legs({.log = "/nonexistent/walk.log"}).error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(open_can_legs({.interfaces = "can0, can1"}));
}

}  // namespace
}  // namespace geoflow::drivers::can
