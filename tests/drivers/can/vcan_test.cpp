#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "can/bus_fixture.hpp"
#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/socket_channel.hpp"
#include "can/socket_reader.hpp"

/// SocketCAN on the kernel's own virtual bus vcan1, which is these tests' alone: `ip link add vcan1
/// type vcan && ip link set vcan1 up`. They are run in a virtual machine: tests/hil/run can.
namespace geoflow::drivers::can {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

const std::string kBus = "vcan1";

/// Waits until something is so; false after half a minute, which is patience and not a bar.
bool comes_true(const std::function<bool()>& holds) {
  const HostTime end = HostClock::now() + std::chrono::seconds{30};
  while (!holds() && HostClock::now() < end) {
    std::this_thread::sleep_for(milliseconds{1});
  }
  return holds();
}

class CountingSink final : public LegSink {
 public:
  void on_legs(const Arrival<LegClock, LegSample>& sample) override {
    const bool is_whole =
        std::ranges::all_of(sample.sample.valid, [](bool heard) { return heard; });
    whole += is_whole ? 1 : 0;
  }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
  std::atomic<int> whole{0};
};

struct VcanTest : testing::Test {
  void SetUp() override {
    if (::if_nametoindex(kBus.c_str()) == 0) {
      GTEST_SKIP() << "needs vcan1 (tests/hil/run can has it)";
    }
    auto socket = open_can_socket(kBus);
    ASSERT_TRUE(socket) << socket.error().message;
    sender = *std::move(socket);
  }

  void send(std::string_view text) const {
    const KernelFrame frame = to_kernel(tests::frame(text));
    ASSERT_EQ(::write(sender.get(), frame.bytes.data(), frame.size),
              static_cast<ssize_t>(frame.size));
  }

  /// `ip link set vcan1 up` or down.
  void set_up(bool up) const {
    ifreq request{};
    kBus.copy(request.ifr_name, IFNAMSIZ - 1);
    ASSERT_EQ(::ioctl(sender.get(), SIOCGIFFLAGS, &request), 0);
    const auto others = static_cast<unsigned>(request.ifr_flags) & ~unsigned{IFF_UP};
    request.ifr_flags = static_cast<short>(others | (up ? unsigned{IFF_UP} : 0U));
    ASSERT_EQ(::ioctl(sender.get(), SIOCSIFFLAGS, &request), 0);
  }

  UniqueFd sender;
};

std::unique_ptr<Channel> open_channel() {
  auto channel = SocketChannel::create({kBus}, tests::dictionary().identifiers());
  EXPECT_TRUE(channel);
  const auto opened = (*channel)->open();
  EXPECT_TRUE(opened) << opened.error().message;
  return std::move(*channel);
}

TEST_F(VcanTest, EachKindOfFrameComesAsItWasSent) {
  const auto channel = open_channel();
  const std::array<std::string_view, 3> sent{
      "110#0CFE9411D8DC0701", "213##1000000002CCF00006A180000EFD8000000007800FF000000",
      "20000040#0000000000000000"};
  const HostTime before = HostClock::now();
  for (const std::string_view text : sent) {
    send(text);
  }
  send("7E8#00");  // foreign
  std::vector<Received> frames;
  ASSERT_TRUE(channel->read(frames, std::chrono::seconds{1}));
  ASSERT_EQ(frames.size(), sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(frames[i].frame, tests::frame(sent[i]));
    // The kernel stamps by the wall clock, whose distance is read a little later.
    EXPECT_GE(frames[i].t_arrival, before - milliseconds{1});
    EXPECT_LE(frames[i].t_arrival, HostClock::now());
  }
}

TEST_F(VcanTest, ForeignFramesComeWhereAllAreListenedTo) {
  const auto channel = open_channel();
  channel->listen(Listen::kToAll);
  send("7E8#00");
  std::vector<Received> frames;
  ASSERT_TRUE(channel->read(frames, std::chrono::seconds{1}));
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].frame.id, 0x7E8U);
}

TEST_F(VcanTest, EachFrameThatTheKernelDropsIsCounted) {
  const auto channel = open_channel();
  constexpr std::size_t kSent = 20000;  // more than its buffer holds
  for (std::size_t i = 0; i < kSent; ++i) {
    send("110#0CFE9411D8DC0701");
  }
  std::vector<Received> frames;
  ASSERT_TRUE(channel->read(frames, std::chrono::seconds{1}));
  EXPECT_LT(frames.size(), kSent);
  send("110#0CFE9411D8DC0701");  // the kernel says it with the next frame
  ASSERT_TRUE(channel->read(frames, std::chrono::seconds{1}));
  EXPECT_EQ(frames.size() + channel->overflowed(), kSent + 1);
}

struct VcanLegsTest : VcanTest {
  void SetUp() override {
    VcanTest::SetUp();
    if (IsSkipped()) {
      return;
    }
    auto opened = open_can_legs({.interfaces = kBus});
    ASSERT_TRUE(opened) << opened.error().message;
    legs = std::move(*opened);
    ASSERT_TRUE(legs->start(sink));
  }
  void TearDown() override {
    if (legs) {
      legs->stop();
    }
  }

  /// Sends rounds, each 2 ms, until something is so.
  bool walks_until(const std::function<bool()>& holds) {
    auto emitter = open_can_emitter({.interface = kBus, .fd = fd});
    EXPECT_TRUE(emitter);
    return emitter && comes_true([&] {
             time += milliseconds{2};
             EmittedSample sample;
             sample.legs.valid.fill(true);
             if (missing_leg) {
               sample.legs.valid.at(*missing_leg) = false;
             }
             sample.device_time = time;
             EXPECT_TRUE((*emitter)->emit(sample));
             return holds();
           });
  }
  /// Walks until so many more samples with all legs came.
  bool arrive(int more) {
    const int wanted = sink.whole + more;
    return walks_until([&] { return sink.whole >= wanted; });
  }
  bool is_well() const { return legs->health().state == SourceState::kStreaming; }
  /// Whether health's reason comes to say that; how long it took goes into the test's report.
  bool says(std::string_view text) const {
    const HostTime begin = HostClock::now();
    const bool said =
        comes_true([&] { return legs->health().reason.find(text) != std::string::npos; });
    record("seen_after_ms", begin);
    return said;
  }
  /// Whether rounds that come again make it well.
  bool recovers() {
    const HostTime begin = HostClock::now();
    const bool well = walks_until([&] { return is_well(); });
    record("well_after_ms", begin);
    return well;
  }
  static void record(const std::string& what, HostTime since) {
    testing::Test::RecordProperty(what,
                                  static_cast<int>((HostClock::now() - since) / milliseconds{1}));
  }

  CountingSink sink;
  std::unique_ptr<Legs> legs;
  Duration time{std::chrono::seconds{1}};
  bool fd = false;
  std::optional<std::size_t> missing_leg;
};

TEST_F(VcanLegsTest, WalkOnClassicFramesAndOnFdFrames) {
  ASSERT_TRUE(arrive(100));
  EXPECT_TRUE(recovers()) << legs->health().reason;
  fd = true;
  ASSERT_TRUE(arrive(100));
}

TEST_F(VcanLegsTest, BusOffIsSaidUntilFramesCome) {
  ASSERT_TRUE(arrive(10));
  send("20000040#0000000000000000");
  EXPECT_TRUE(says("bus-off")) << legs->health().reason;
  EXPECT_TRUE(recovers()) << legs->health().reason;
}

TEST_F(VcanLegsTest, SilenceIsSaid) {
  ASSERT_TRUE(arrive(10));
  EXPECT_TRUE(says("nothing comes")) << legs->health().reason;
  EXPECT_TRUE(recovers()) << legs->health().reason;
}

TEST_F(VcanLegsTest, ForeignFramesAreSaid) {
  ASSERT_TRUE(arrive(10));
  const HostTime begin = HostClock::now();
  EXPECT_TRUE(comes_true([&] {
    send("7E8#00");
    return legs->health().reason.find("7E8") != std::string::npos;
  })) << legs->health().reason;
  record("seen_after_ms", begin);
  EXPECT_TRUE(recovers()) << legs->health().reason;
}

TEST_F(VcanLegsTest, AMissingLegIsSaid) {
  ASSERT_TRUE(arrive(10));
  missing_leg = 2;
  const HostTime begin = HostClock::now();
  EXPECT_TRUE(walks_until([&] {
    return legs->health().reason.find("missing: leg RR") != std::string::npos;
  })) << legs->health().reason;
  record("seen_after_ms", begin);
  missing_leg.reset();
  EXPECT_TRUE(recovers()) << legs->health().reason;
}

TEST_F(VcanLegsTest, AnInterfaceThatGoesDownIsReadAgainWhenItIsUp) {
  ASSERT_TRUE(arrive(10));
  set_up(false);
  EXPECT_TRUE(says("is down")) << legs->health().reason;
  set_up(true);
  EXPECT_TRUE(recovers()) << legs->health().reason;
  EXPECT_TRUE(arrive(10));
}

}  // namespace
}  // namespace geoflow::drivers::can
