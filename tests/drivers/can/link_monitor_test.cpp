#include "can/link_monitor.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "can/bus_fixture.hpp"
#include "can/frame.hpp"
#include "can/snapshot.hpp"

namespace geoflow::drivers::can {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::HasSubstr;
using tests::dictionary;
using tests::rounds;

constexpr HostTime kBegin{std::chrono::seconds{100}};

/// A bus, its assembler and its monitor on a time of their own.
class Link {
 public:
  Link() { monitor_.opened(kBegin); }

  void send(const std::vector<Received>& frames) {
    for (const Received& received : frames) {
      now_ = received.t_arrival;
      monitor_.on_frame(received, assembler_.push(received));
      while (assembler_.pop(now_)) {
      }
    }
  }
  /// `count` more rounds; frames for which `lost` holds do not come.
  void run(std::uint64_t count, bool (*lost)(const Received&) = nullptr) {
    auto frames = rounds(next_, count, kBegin + round_time(next_));
    if (lost != nullptr) {
      std::erase_if(frames, lost);
    }
    send(frames);
    next_ += count;
  }
  void send(std::string_view text) { send({{.frame = tests::frame(text), .t_arrival = now_}}); }
  /// Nothing comes until the trouble is seen: how long that takes, to the millisecond.
  Duration time_until(LinkTrouble trouble) {
    const HostTime begin = now_;
    while (report().trouble != trouble && now_ - begin < std::chrono::seconds{10}) {
      now_ += milliseconds{1};
    }
    return now_ - begin;
  }
  void wait(Duration time) { now_ += time; }
  [[nodiscard]] LinkReport report() const { return monitor_.assess(now_, assembler_); }
  [[nodiscard]] HostTime now() const { return now_; }
  LinkMonitor& monitor() { return monitor_; }

 private:
  static Duration round_time(std::uint64_t round) {
    return static_cast<std::int64_t>(round) * tests::kRoundPeriod;
  }
  SnapshotAssembler assembler_{dictionary()};
  LinkMonitor monitor_{dictionary(), {"can0"}};
  HostTime now_ = kBegin;
  std::uint64_t next_ = 0;
};

bool is_front_left(const Received& received) {
  return received.frame.id > 0x100 && received.frame.id % 16 == 1;
}

TEST(LinkMonitor, AWorkingBusIsWell) {
  Link link;
  link.run(100);
  const LinkReport report = link.report();
  EXPECT_EQ(report.trouble, LinkTrouble::kNone);
  EXPECT_EQ(report.state, SourceState::kStreaming);
  EXPECT_EQ(report.reason, "");
}

TEST(LinkMonitor, SilenceIsSeenAfter50Milliseconds) {
  Link link;
  EXPECT_EQ(link.time_until(LinkTrouble::kSilent), milliseconds{51});  // from the very beginning
  link.run(100);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
  EXPECT_EQ(link.time_until(LinkTrouble::kSilent), milliseconds{51});
  EXPECT_EQ(link.report().state, SourceState::kFailed);
  EXPECT_THAT(link.report().reason, AllOf(HasSubstr("can0: nothing comes"), HasSubstr("bit rate")));
  EXPECT_TRUE(link.monitor().is_silent(link.now()));
}

TEST(LinkMonitor, AMissingLegIsNamedWithItsIdentifiersAfter50Milliseconds) {
  Link link;
  link.run(100);
  link.run(24, is_front_left);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);  // 48 ms
  link.run(2, is_front_left);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kMissingLeg);
  EXPECT_EQ(link.report().state, SourceState::kDegraded);
  EXPECT_EQ(link.report().reason, "missing: leg FL (0x111, 0x121, 0x131, 0x211)");
  link.run(1);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
}

TEST(LinkMonitor, BusOffIsSeenAtOnceAndUntilFramesComeAgain) {
  Link link;
  link.run(100);
  link.send("20000040#0000000000000000");
  EXPECT_EQ(link.report().trouble, LinkTrouble::kBusOff);
  EXPECT_EQ(link.report().state, SourceState::kFailed);
  EXPECT_THAT(link.report().reason, AllOf(HasSubstr("can0 is bus-off"),
                                          HasSubstr("ip link set can0 type can restart-ms")));
  link.wait(std::chrono::seconds{5});
  EXPECT_EQ(link.report().trouble, LinkTrouble::kBusOff);
  link.send("20000100#0000000000000000");  // the controller has restarted
  EXPECT_EQ(link.report().trouble, LinkTrouble::kSilent);
  link.send("20000040#0000000000000000");
  link.run(3000);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
}

TEST(LinkMonitor, ForeignFramesAloneAreNamed) {
  Link link;
  link.run(100);
  link.wait(milliseconds{60});
  for (const std::string_view text : {"7E8#00", "7E8#01", "7E0#02", "18DAF110#03"}) {
    link.send(text);
  }
  EXPECT_EQ(link.report().trouble, LinkTrouble::kForeignOnly);
  EXPECT_EQ(link.report().state, SourceState::kFailed);
  EXPECT_THAT(link.report().reason, AllOf(HasSubstr("can0: frames come (0x7E8, 0x7E0, 0x18DAF110)"),
                                          HasSubstr("wrong interface, or wrong dictionary?")));
}

TEST(LinkMonitor, ForeignFramesBesideTheLegsAreNoTrouble) {
  Link link;
  link.run(100);
  link.send("7E8#00");
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
}

TEST(LinkMonitor, FramesOfAnotherLengthTellAWrongDictionary) {
  Link link;
  link.wait(milliseconds{60});
  link.send("110#00112233");
  EXPECT_EQ(link.report().trouble, LinkTrouble::kForeignOnly);
  EXPECT_THAT(link.report().reason, HasSubstr("shorter than the dictionary config/go2_legs.dbc"));
}

TEST(LinkMonitor, OverflowIsSaidForASecond) {
  Link link;
  link.run(100);
  link.monitor().on_overflow(0, link.now());
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
  link.monitor().on_overflow(17, link.now());
  EXPECT_EQ(link.report().trouble, LinkTrouble::kOverflow);
  EXPECT_EQ(link.report().state, SourceState::kDegraded);
  EXPECT_THAT(link.report().reason, HasSubstr("dropped 17 frames"));
  link.run(500);
  link.monitor().on_overflow(17, link.now());
  EXPECT_EQ(link.report().trouble, LinkTrouble::kOverflow);
  link.run(10);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
}

TEST(LinkMonitor, ErrorReportsOfTheControllerAreSaidForASecond) {
  Link link;
  link.run(100);
  link.send("20000004#0010000000000000");  // error-passive on reception
  EXPECT_EQ(link.report().trouble, LinkTrouble::kErrorPassive);
  EXPECT_EQ(link.report().state, SourceState::kDegraded);
  link.send("20000004#0001000000000000");  // its buffer overflowed
  EXPECT_EQ(link.report().trouble, LinkTrouble::kOverflow);
  EXPECT_THAT(link.report().reason, HasSubstr("controller's receive buffer"));
  link.run(510);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
}

TEST(LinkMonitor, ALegWithACounterOfItsOwnIsToldFromASilentOne) {
  Link link;
  link.run(100);
  auto frames = rounds(100, 40, link.now() + tests::kRoundPeriod);
  for (Received& received : frames) {
    if (received.frame.id == 0x112) {
      received.frame.data[6] =
          static_cast<std::byte>(std::to_integer<unsigned>(received.frame.data[6]) + 40U);
    }
  }
  link.send(frames);
  EXPECT_EQ(link.report().trouble, LinkTrouble::kOutOfStep);
  EXPECT_THAT(link.report().reason, HasSubstr("leg RR: its counter is not SYNC's"));
}

TEST(LinkMonitor, AnInterfaceThatCannotBeOpenedIsSaidAsItIs) {
  Link link;
  link.run(100);
  link.monitor().failed({.code = ErrorCode::kUnavailable, .message = "can0: Network is down"});
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNoInterface);
  EXPECT_EQ(link.report().state, SourceState::kFailed);
  EXPECT_EQ(link.report().reason, "can0: Network is down");
  link.monitor().opened(link.now());
  EXPECT_EQ(link.report().trouble, LinkTrouble::kNone);
}

}  // namespace
}  // namespace geoflow::drivers::can
