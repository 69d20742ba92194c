#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "tests/support/data.hpp"

#include "notify_socket.hpp"
#include "pipeline/pulse.hpp"
#include "service/change_log.hpp"
#include "service/given_sockets.hpp"
#include "service/notify.hpp"
#include "service/reporter.hpp"
#include "service/source_watch.hpp"
#include "service/status_line.hpp"
#include "service/watchdog.hpp"

namespace geoflow::daemon::service {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

HostTime at(Duration since_start) {
  return HostTime{std::chrono::hours{1}} + since_start;
}

/// One variable of the environment, for the scope.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_{name} {
    ::setenv(name, value.c_str(), 1);  // NOLINT(concurrency-mt-unsafe): no other thread
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;
  ~Variable() { ::unsetenv(name_); }  // NOLINT(concurrency-mt-unsafe): no other thread

 private:
  const char* name_;
};

using Threads = std::vector<ThreadActivity>;

TEST(WatchdogTest, IsFedSeveralTimesAPeriodWhileThreadsMove) {
  Watchdog watchdog{seconds{1}};
  int feeds = 0;
  for (int i = 0; i < 100; ++i) {
    const Threads threads = {{.name = "slam", .turns = static_cast<std::uint64_t>(i)}};
    feeds += watchdog.look(threads, at(i * milliseconds{100})).feed ? 1 : 0;
  }
  EXPECT_GE(feeds, 20);  // two a period
  EXPECT_LE(feeds, 50);
}

TEST(WatchdogTest, StarvesWhenOneThreadHasWorkAndStandsStill) {
  Watchdog watchdog{seconds{1}};
  const auto look = [&](std::uint64_t turns, Duration t) {
    const Threads threads = {{.name = "sync", .turns = turns + 100},
                             {.name = "slam", .turns = 7, .idle = false}};
    return watchdog.look(threads, at(t));
  };
  EXPECT_TRUE(look(0, seconds{0}).feed);
  EXPECT_TRUE(look(1, milliseconds{900}).feed);
  const auto late = look(2, milliseconds{1100});
  EXPECT_FALSE(late.feed);
  EXPECT_EQ(late.stuck, "slam");
  EXPECT_FALSE(look(3, seconds{60}).feed);
}

TEST(WatchdogTest, WaitingIsNotStandingStill) {
  Watchdog watchdog{seconds{1}};
  for (int i = 0; i < 1000; ++i) {
    const Threads threads = {{.name = "slam", .turns = 7, .idle = true}};
    ASSERT_TRUE(watchdog.look(threads, at(i * seconds{1})).feed);
  }
  // Work that comes then has a whole period.
  const Threads busy = {{.name = "slam", .turns = 7}};
  EXPECT_TRUE(watchdog.look(busy, at(milliseconds{999'900})).feed);
  EXPECT_EQ(watchdog.look(busy, at(milliseconds{1'000'500})).stuck, "slam");
}

TEST(WatchdogTest, LongWorkMayTakeTenPeriods) {
  Watchdog watchdog{seconds{1}};
  const Threads threads = {{.name = "map", .turns = 1, .long_work = true}};
  EXPECT_TRUE(watchdog.look(threads, at({})).feed);
  EXPECT_TRUE(watchdog.look(threads, at(seconds{9})).feed);
  EXPECT_EQ(watchdog.look(threads, at(seconds{11})).stuck, "map");
}

TEST(WatchdogTest, WithoutAPeriodNobodyIsTold) {
  Watchdog watchdog{Duration::zero()};
  const Threads threads = {{.name = "slam"}};
  EXPECT_FALSE(watchdog.look(threads, at({})).feed);
  EXPECT_TRUE(watchdog.look(threads, at(seconds{100})).stuck.empty());
}

TEST(PulseTest, AThreadIsIdleWhileItWaitsAndNothingWaitsForIt) {
  auto bell = timesync::Doorbell::create().value();
  Pulse pulse;
  EXPECT_FALSE(pulse.activity("slam", bell).idle);  // on its way to its first wait
  std::thread thread{[&] { (void)pulse.wait(bell); }};
  const HostTime deadline = HostClock::now() + std::chrono::minutes{1};
  while (!pulse.activity("slam", bell).idle && HostClock::now() < deadline) {
    std::this_thread::sleep_for(milliseconds{1});
  }
  EXPECT_TRUE(pulse.activity("slam", bell).idle);
  EXPECT_EQ(pulse.activity("slam", bell).turns, 0U);
  bell.ring();
  thread.join();
  EXPECT_FALSE(pulse.activity("slam", bell).idle);
  EXPECT_EQ(pulse.activity("slam", bell).turns, 1U);
  pulse.end();
  EXPECT_TRUE(pulse.activity("slam", bell).idle);
}

geoflow_pose tracking() {
  geoflow_pose pose{};
  pose.status = GEOFLOW_TRACKING;
  pose.quality = 87;
  return pose;
}

SourceReport streaming(const std::string& name, std::uint64_t delivered) {
  return {.name = name,
          .health = {.state = SourceState::kStreaming, .reason = {}, .delivered = delivered}};
}

TEST(SourceWatchTest, ASourceIsSilentWhenNothingHasComeForMoreThanASecondAndAHalf) {
  SourceWatch watch;
  const auto look = [&](std::uint64_t delivered, Duration t) {
    watch.look({streaming("camera", delivered)}, at(t));
    return watch.sources().front();
  };
  const WatchedSource first = look(0, {});
  EXPECT_FALSE(first.since_sample);
  EXPECT_FALSE(first.silent);
  const WatchedSource never = look(0, seconds{2});  // whatever its driver says
  EXPECT_FALSE(never.since_sample);
  EXPECT_EQ(never.silent, seconds{2});
  const WatchedSource heard = look(1, seconds{3});
  EXPECT_EQ(heard.since_sample, Duration::zero());
  EXPECT_FALSE(heard.silent);
  EXPECT_FALSE(look(1, milliseconds{4500}).silent);
  EXPECT_EQ(look(1, milliseconds{4600}).silent, milliseconds{1600});
  EXPECT_FALSE(look(0, seconds{5}).silent);  // it has begun anew
}

TEST(SourceWatchTest, TheStatusReplyHasTheAgeOfTheNewestSampleAndSilenceAsAState) {
  SourceWatch watch;
  watch.look({streaming("camera", 5), streaming("legs", 0)}, at({}));
  watch.look({streaming("camera", 6), streaming("legs", 0)}, at(seconds{2}));
  watch.look({streaming("camera", 6), streaming("legs", 0)}, at(milliseconds{2250}));
  const nlohmann::json health = to_json(watch.sources());
  EXPECT_EQ(health.at("camera").at("state"), "streaming");
  EXPECT_EQ(health.at("camera").at("last_sample_s"), 0.25);
  EXPECT_EQ(health.at("camera").at("delivered"), 6);
  EXPECT_EQ(health.at("legs").at("state"), "silent");
  EXPECT_EQ(health.at("legs").at("last_sample_s"), nullptr);
}

TEST(StatusLineTest, TellsStatusRateQualityTimeAndSources) {
  StatusLine line;
  SourceWatch watch;
  std::string text;
  for (std::uint64_t s = 0; s <= 250; ++s) {
    const HostTime now = at(s * seconds{1});
    watch.look({streaming("camera", 30 * s), streaming("imu", 200 * s),
                streaming("legs", 400 * std::min<std::uint64_t>(s, 248))},
               now);
    text = line.update({.pose = tracking(), .frames = 30 * s, .sources = watch.sources()}, now);
  }
  EXPECT_EQ(text, "TRACKING 30 Hz, quality 87, 4 min; camera ok, IMU ok, legs silent 2 s");
}

TEST(StatusLineTest, SaysWhatASourceSaysOfItself) {
  StatusLine line;
  WatchedSource camera{.name = "camera",
                       .health = {.state = SourceState::kDegraded, .reason = "the camera is away"}};
  EXPECT_EQ(line.update({.sources = {camera}}, at({})),
            "STARTING; camera degraded (the camera is away)");
  camera.silent = seconds{130};
  EXPECT_EQ(line.update({.sources = {camera}}, at(seconds{130})),
            "STARTING; camera silent 2 min (the camera is away)");
  camera.silent.reset();
  camera.health.state = SourceState::kFailed;
  EXPECT_EQ(line.update({.sources = {camera}}, at(seconds{131})),
            "STARTING; camera failed (the camera is away)");
}

TEST(StatusLineTest, SaysWhyThereIsNoSource) {
  StatusLine line;
  EXPECT_EQ(line.update({.trouble = "no D435i is connected"}, at({})),
            "STARTING; no D435i is connected");
}

TEST(StatusLineTest, ASourceThatBeginsAnewHasARateAgain) {
  StatusLine line;
  (void)line.update({.pose = tracking(), .frames = 900}, at(seconds{0}));
  (void)line.update({.pose = tracking(), .frames = 0}, at(seconds{1}));
  EXPECT_THAT(line.update({.pose = tracking(), .frames = 15}, at(seconds{2})), HasSubstr(" 15 Hz"));
}

TEST(StatusLineTest, TimesAreInWholeUnits) {
  EXPECT_EQ(in_words(milliseconds{1999}), "1 s");
  EXPECT_EQ(in_words(seconds{119}), "119 s");
  EXPECT_EQ(in_words(seconds{120}), "2 min");
  EXPECT_EQ(in_words(std::chrono::minutes{119}), "119 min");
  EXPECT_EQ(in_words(std::chrono::hours{47}), "47 h");
  EXPECT_EQ(in_words(std::chrono::hours{48}), "2 d");
}

TEST(ReporterTest, SpeaksTheManagersProtocol) {
  const tests::TemporaryDirectory directory;
  tests::NotifySocket manager{directory.path() / "notify"};
  const Variable variable{"NOTIFY_SOCKET", manager.path().string()};
  Reporter reporter{seconds{1}};
  ASSERT_TRUE(reporter.is_due(at({})));
  reporter.tell({.trouble = "no D435i is connected"}, at({}));
  EXPECT_FALSE(reporter.is_due(at(milliseconds{500})));
  reporter.ready();
  reporter.ready();
  reporter.tell({.trouble = "no D435i is connected"}, at(seconds{1}));  // nothing new
  Threads threads = {{.name = "slam", .turns = 1}};
  reporter.watch(threads, at(seconds{1}));
  reporter.watch(threads, at(seconds{3}));  // stuck: no word
  reporter.tell({}, at(seconds{3}));
  threads.front().turns = 2;
  reporter.watch(threads, at(seconds{4}));
  reporter.stopping("stopping");
  ASSERT_TRUE(manager.wait_for("STOPPING"));
  EXPECT_THAT(manager.messages(), ElementsAre("STATUS=STARTING; no D435i is connected",
                                              "READY=1\nSTATUS=STARTING; no D435i is connected",
                                              "WATCHDOG=1", "STATUS=thread slam is stuck; STARTING",
                                              "WATCHDOG=1", "STOPPING=1\nSTATUS=stopping"));
}

TEST(ChangeLogTest, TellsStatusAndSourcesWhenTheyChangeWithFieldsForPrograms) {
  std::vector<std::string> lines;
  log::set_sink([&](const log::Line& line) {
    lines.emplace_back(line.level == log::Level::kWarning ? "warning " : "");
    lines.back() += line.message;
    for (const auto& [name, value] : line.fields) {
      lines.back() += fmt::format(" {}={}", name, value);
    }
  });
  ChangeLog changes;
  WatchedSource legs{.name = "legs", .health = streaming("legs", 1).health};
  geoflow_pose pose = tracking();
  changes.note({.sources = {legs}}, at({}));
  changes.note({.pose = pose, .sources = {legs}}, at(seconds{1}));
  changes.note({.pose = pose, .sources = {legs}}, at(seconds{2}));
  pose.status = GEOFLOW_LOST;
  legs.silent = seconds{2};
  changes.note({.pose = pose, .sources = {legs}}, at(seconds{4}));
  legs.silent = seconds{3};
  changes.note({.pose = pose, .sources = {legs}}, at(seconds{5}));
  log::set_sink({});
  EXPECT_THAT(lines,
              ElementsAre("legs ok GEOFLOW_SENSOR=legs GEOFLOW_STATE=streaming",
                          "TRACKING GEOFLOW_STATUS=TRACKING",
                          "warning LOST, after 3 s of TRACKING GEOFLOW_STATUS=LOST",
                          "warning legs silent 2 s GEOFLOW_SENSOR=legs GEOFLOW_STATE=silent"));
}

TEST(NotifyTest, AManagerThatIsNotThereIsNotedOnce) {
  std::vector<std::string> lines;
  log::set_sink([&](const log::Line& line) { lines.emplace_back(line.message); });
  const Variable variable{"NOTIFY_SOCKET", "/nonexistent/notify"};
  notify_ready("STARTING");
  notify_watchdog();
  log::set_sink({});
  EXPECT_THAT(lines, ElementsAre(HasSubstr("$NOTIFY_SOCKET: No such file or directory")));
}

TEST(NotifyTest, TheWatchdogsPeriodComesFromTheEnvironment) {
  EXPECT_EQ(watchdog_period(), Duration::zero());
  const Variable period{"WATCHDOG_USEC", "2500000"};
  EXPECT_EQ(watchdog_period(), Duration{milliseconds{2500}});
  const Variable other{"WATCHDOG_PID", "1"};
  EXPECT_EQ(watchdog_period(), Duration::zero());
}

TEST(NotifyTest, AWatchdogPeriodThatIsNoneIsTakenAsNone) {
  for (const char* value : {"soon", "-1", "", "0"}) {
    const Variable period{"WATCHDOG_USEC", value};
    EXPECT_EQ(watchdog_period(), Duration::zero()) << value;
  }
}

TEST(GivenSocketsTest, NoneAreTakenWhereNoneAreGiven) {
  const auto none = take_given_sockets();
  ASSERT_TRUE(none) << none.error().message;
  EXPECT_FALSE(none->pose);
  EXPECT_FALSE(none->control);
  // Those of another process are not ours.
  const Variable fds{"LISTEN_FDS", "2"};
  const Variable pid{"LISTEN_PID", "1"};
  const auto others = take_given_sockets();
  ASSERT_TRUE(others) << others.error().message;
  EXPECT_FALSE(others->pose);
}

TEST(GivenSocketsTest, WhatIsNoNumberIsAnError) {
  for (const char* value : {"two", "-3", "99999999999999999999", "1 "}) {
    const Variable fds{"LISTEN_FDS", value};
    const Variable pid{"LISTEN_PID", std::to_string(::getpid())};
    const auto given = take_given_sockets();
    ASSERT_FALSE(given) << value;
    EXPECT_EQ(given.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(given.error().message, HasSubstr(std::string{"$LISTEN_FDS="} + value));
  }
}

}  // namespace
}  // namespace geoflow::daemon::service
