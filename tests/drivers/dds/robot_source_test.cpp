#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/channel.hpp"
#include "dds/low_state_fixture.hpp"

// Real DDS over the loopback interface: a writer as the robot's, and the reader of the daemon.

namespace geoflow::drivers::dds {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// Another domain for each run on this machine, so that runs at the same time do not hear each
/// other.
std::uint32_t own_domain() {
  return static_cast<std::uint32_t>(10 + ::getpid() % 200);
}

class CountingSink final : public LegSink, public ImuSink {
 public:
  void on_legs(const Arrival<LegClock, LegSample>& sample) override {
    const auto t = sample.t_device.time_since_epoch();
    in_order = in_order && t > last_;
    last_ = t;
    ++legs;
  }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
  void on_imu(const Arrival<ImuClock, ImuSample>& /*sample*/) override { ++imus; }
  std::atomic<std::uint32_t> legs{0};
  std::atomic<std::uint32_t> imus{0};
  std::atomic<bool> in_order{true};

 private:
  Duration last_{-1};
};

template <typename Condition>
bool eventually(const Condition& condition) {
  const HostTime end = HostClock::now() + std::chrono::seconds{30};
  while (!condition() && HostClock::now() < end) {
    std::this_thread::sleep_for(milliseconds{2});
  }
  return condition();
}

/// A robot on the loopback interface; none where the program has no DDS.
class LoopbackTest : public testing::Test {
 protected:
  void SetUp() override {
    auto publisher = make_publisher(address_);
    if (!publisher && publisher.error().code == ErrorCode::kUnsupported) {
      GTEST_SKIP() << publisher.error().message;
    }
    ASSERT_TRUE(publisher) << publisher.error().message;
    robot_ = *std::move(publisher);
  }
  void listen() {
    auto opened = DdsRobot::open({.interface = "lo", .domain = static_cast<int>(address_.domain)});
    ASSERT_TRUE(opened) << opened.error().message;
    reader_ = *std::move(opened);
    ASSERT_TRUE(reader_->legs().start(sink_));
    ASSERT_TRUE(reader_->body_imu().start(sink_));
  }
  /// Writes messages 2 ms apart; a late one is made up for, as a robot's clock does not wait.
  void write(std::uint32_t first, std::uint32_t count) {
    const HostTime begin = HostClock::now();
    for (std::uint32_t i = 0; i < count; ++i) {
      std::this_thread::sleep_until(begin + i * milliseconds{2});
      const auto written = robot_->write(tests::low_state(first + i));
      ASSERT_TRUE(written) << written.error().message;
    }
  }
  Address address_{.domain = own_domain(), .interface = "lo"};
  std::unique_ptr<Publisher> robot_;
  std::unique_ptr<DdsRobot> reader_;
  CountingSink sink_;
};

TEST_F(LoopbackTest, FiveHundredMessagesASecondComeWithoutLoss) {
  listen();
  ASSERT_TRUE(eventually([&] { return robot_->readers() > 0; }));
  constexpr std::uint32_t kMessages = 2000;  // four seconds
  write(0, kMessages);
  EXPECT_TRUE(eventually([&] { return sink_.legs == kMessages; })) << sink_.legs;
  EXPECT_EQ(sink_.imus, sink_.legs);
  EXPECT_TRUE(sink_.in_order);
  EXPECT_EQ(reader_->legs().health().delivered, kMessages);
  EXPECT_EQ(reader_->legs().health().rejected, 0U);
  EXPECT_EQ(reader_->legs().stamps().domain, StampDomain::kDevice);
  EXPECT_EQ(reader_->legs().stamps().wrap, milliseconds{std::int64_t{1} << 32U});
}

TEST_F(LoopbackTest, SilenceAndAMissingRobotAreToldApart) {
  listen();
  ASSERT_TRUE(eventually([&] { return robot_->readers() > 0; }));
  EXPECT_TRUE(eventually([&] {
    return reader_->legs().health().reason.find("the robot is there, but sends nothing") !=
           std::string::npos;
  }));
  EXPECT_EQ(reader_->legs().health().state, SourceState::kFailed);
  write(0, 50);
  EXPECT_TRUE(eventually([&] { return sink_.legs == 50; })) << sink_.legs;
  robot_.reset();
  EXPECT_TRUE(eventually([&] {
    return reader_->legs().health().reason.find("no robot sends it") != std::string::npos;
  })) << reader_->legs().health().reason;
}

TEST_F(LoopbackTest, AnInterfaceThatIsNotThereIsSaidAndWaitedFor) {
  auto opened = DdsRobot::open({.interface = "nonet7", .domain = 231});
  ASSERT_TRUE(opened) << opened.error().message;
  ASSERT_TRUE((*opened)->legs().start(sink_));
  EXPECT_TRUE(eventually([&] {
    return (*opened)->legs().health().reason ==
           "rt/lowstate on nonet7, domain 231: no such network interface";
  }));
  EXPECT_EQ((*opened)->legs().health().state, SourceState::kFailed);
  (*opened)->legs().stop();
  EXPECT_EQ((*opened)->legs().health().state, SourceState::kStopped);
}

}  // namespace
}  // namespace geoflow::drivers::dds
