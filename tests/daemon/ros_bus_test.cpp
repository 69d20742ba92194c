#include "bus/ros_bus.hpp"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "service/status_line.hpp"
#include "synthetic_recording.hpp"

// A ROS 2 machine (tests/support/ros) hears what is said on the loopback interface.

namespace geoflow::daemon::bus {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::Process;
using Fields = std::vector<std::string>;

// Where an odometry line has what: 3 texts, then numbers.
constexpr std::size_t kStamp = 1;
constexpr std::size_t kFrame = 2;
constexpr std::size_t kPosition = 4;
constexpr std::size_t kCovariance = kPosition + 3 + 4;
constexpr std::size_t kLinear = kCovariance + 36;
constexpr std::size_t kTwistCovariance = kLinear + 3 + 3;

/// Another domain for each run on this machine, so that runs at the same time do not hear each
/// other.
int own_domain() {
  return 10 + ::getpid() % 200;
}

class RosBusTest : public testing::Test {
 protected:
  RosBusTest() {
    config_.publish = true;
    config_.publisher.interface = "lo";
    config_.publisher.domain = own_domain();
  }

  [[nodiscard]] std::unique_ptr<Process> listen(const std::string& name) const {
    return std::make_unique<Process>(
        std::vector<std::string>{ROS_LISTENER_PROGRAM, std::to_string(own_domain()), "lo", name},
        directory_.path() / ("listener" + name));
  }
  [[nodiscard]] std::unique_ptr<Process> start_daemon(const std::string& name,
                                                      std::vector<std::string> settings) const {
    const auto recording = directory_.path() / "recording";
    if (!std::filesystem::exists(recording)) {
      tests::write_synthetic_recording(recording, {});
    }
    settings.insert(settings.end(),
                    {"ros.publish=true", "ros.interface=lo", "ros.name=" + name,
                     "ros.domain=" + std::to_string(own_domain()), "ros.odom_frame=odom" + name});
    std::vector<std::string> arguments = {
        GEOFLOWD_PROGRAM,   "--replay",
        recording.string(), "--loop",
        "--pose-socket",    (directory_.path() / (name + "pose.sock")).string(),
        "--control-socket", (directory_.path() / (name + "ctl.sock")).string()};
    for (const std::string& setting : settings) {
      arguments.insert(arguments.end(), {"--set", setting});
    }
    return std::make_unique<Process>(arguments, directory_.path() / ("daemon" + name));
  }

  /// The lines of one kind that a listener has printed whole.
  static std::vector<Fields> heard(const Process& listener, const std::string& kind) {
    std::vector<Fields> lines;
    std::istringstream text{listener.out()};
    for (std::string line; std::getline(text, line) && !text.eof();) {
      std::istringstream fields{line};
      Fields split;
      for (std::string field; std::getline(fields, field, '\t');) {
        split.push_back(field);
      }
      if (!split.empty() && split.front() == kind) {
        lines.push_back(std::move(split));
      }
    }
    return lines;
  }
  static bool eventually(const std::function<bool()>& condition) {
    const HostTime end = HostClock::now() + std::chrono::seconds{60};
    while (!condition() && HostClock::now() < end) {
      std::this_thread::sleep_for(milliseconds{5});
    }
    return condition();
  }

  tests::TemporaryDirectory directory_;
  RosConfig config_;
};

std::vector<double> numbers(const Fields& fields, std::size_t first, std::size_t count) {
  std::vector<double> values;
  values.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    values.push_back(std::stod(fields.at(first + i)));
  }
  return values;
}

/// A pose whose numbers tell each other apart.
geoflow_pose numbered_pose(std::int64_t t_ns) {
  geoflow_pose pose{};
  pose.t_capture_ns = t_ns;
  pose.realtime_minus_mono_ns = 1'000'000'000;
  pose.status = GEOFLOW_TRACKING;
  std::copy_n(std::vector<double>{1, 2, 3}.begin(), 3, &pose.p_odom_base[0]);
  std::copy_n(std::vector<double>{7, 8, 9}.begin(), 3, &pose.p_map_odom[0]);
  std::copy_n(std::vector<double>{0.1, 0.2, 0.3}.begin(), 3, &pose.v_base[0]);
  std::copy_n(std::vector<double>{0.4, 0.5, 0.6}.begin(), 3, &pose.w_base[0]);
  pose.q_odom_base[2] = pose.q_map_odom[3] = 1;  // half a turn about z; none
  double entry = 1;
  for (double& covariance : pose.covariance) {
    covariance = entry++;
  }
  return pose;
}

TEST_F(RosBusTest, ARos2MachineHearsPoseTransformsAndDiagnostics) {
  const auto listener = listen("");
  auto bus = RosBus::start(config_);
  ASSERT_TRUE(bus) << bus.error().message;
  service::Observation seen;
  seen.sources = {{.name = "legs", .health = {.state = SourceState::kFailed, .reason = "no can0"}}};
  std::int64_t t_ns = 0;
  ASSERT_TRUE(eventually([&] {
    (*bus)->publish(numbered_pose(t_ns += 100'000'000));
    (*bus)->report(seen, "TRACKING");
    return heard(*listener, "odom").size() > 2 && heard(*listener, "diagnostic").size() > 1;
  })) << (*bus)->trouble();

  const Fields odom = heard(*listener, "odom").back();
  EXPECT_EQ(std::stoll(odom[kStamp]) % 100'000'000, 0);
  EXPECT_THAT(Fields(&odom[kFrame], &odom[kFrame] + 2), ElementsAre("odom", "base_link"));
  EXPECT_THAT(numbers(odom, kPosition, 7), ElementsAre(1, 2, 3, 0, 0, 1, 0));
  EXPECT_THAT(numbers(odom, kLinear, 6), ElementsAre(0.1, 0.2, 0.3, 0.4, 0.5, 0.6));
  EXPECT_THAT(numbers(odom, kCovariance, 36), ElementsAre(1, 2, 3, 4, 5, 6,       //
                                                          2, 7, 8, 9, 10, 11,     //
                                                          3, 8, 12, 13, 14, 15,   //
                                                          4, 9, 13, 16, 17, 18,   //
                                                          5, 10, 14, 17, 19, 20,  //
                                                          6, 11, 15, 18, 20, 21));
  EXPECT_THAT(numbers(odom, kTwistCovariance, 8),
              ElementsAre(testing::DoubleEq(0.01), 0, 0, 0, 0, 0, 0, testing::DoubleEq(0.01)));

  const auto transforms = heard(*listener, "transform");
  ASSERT_GE(transforms.size(), 2U);
  EXPECT_THAT(Fields(&transforms[0][kFrame], &transforms[0][kFrame] + 2),
              ElementsAre("map", "odom"));
  EXPECT_THAT(numbers(transforms[0], kPosition, 7), ElementsAre(7, 8, 9, 0, 0, 0, 1));
  EXPECT_THAT(Fields(&transforms[1][kFrame], &transforms[1][kFrame] + 2),
              ElementsAre("odom", "base_link"));
  EXPECT_EQ(transforms[0][kStamp], transforms[1][kStamp]);
  EXPECT_THAT(
      heard(*listener, "diagnostic"),
      AllOf(Contains(ElementsAre("diagnostic", "1", "geoflow: pose", "TRACKING", "geoflow")),
            Contains(ElementsAre("diagnostic", "2", "geoflow: legs", "no can0", "geoflow"))));
}

TEST_F(RosBusTest, DiscoveryShowsRos2sTypeNamesAndQualityOfService) {
  const auto bus = RosBus::start(config_);
  ASSERT_TRUE(bus) << bus.error().message;
  const auto listener = listen("");
  EXPECT_TRUE(eventually([&] { return heard(*listener, "writer").size() >= 3; }));
  EXPECT_THAT(
      heard(*listener, "writer"),
      testing::UnorderedElementsAre(
          ElementsAre("writer", "rt/odom", "nav_msgs::msg::dds_::Odometry_", "reliable", "volatile",
                      "10"),
          ElementsAre("writer", "rt/tf", "tf2_msgs::msg::dds_::TFMessage_", "reliable", "volatile",
                      "100"),
          ElementsAre("writer", "rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_",
                      "reliable", "volatile", "10")));
}

TEST_F(RosBusTest, WhatCannotBeJoinedIsSaidAndTriedAgain) {
  config_.publisher.interface = "nonet7";
  const auto bus = RosBus::start(config_);
  ASSERT_TRUE(bus) << bus.error().message;
  EXPECT_TRUE(eventually([&] { return !(*bus)->trouble().empty(); }));
  EXPECT_THAT((*bus)->trouble(), HasSubstr("rt/odom on nonet7"));
  (*bus)->publish(numbered_pose(1));
  EXPECT_EQ((*bus)->published(), 0U);
  config_.publisher.name = "1";
  EXPECT_FALSE(RosBus::start(config_));
}

TEST_F(RosBusTest, OneDomainIsOnOneInterface) {
  const auto bus = RosBus::start(config_);
  ASSERT_TRUE(bus) << bus.error().message;
  ASSERT_TRUE(eventually([&] {
    (*bus)->publish(numbered_pose(HostClock::now().time_since_epoch().count()));
    return (*bus)->published() > 0;
  }));
  // Another one of this process, say for the robot's own network.
  RosConfig other = config_;
  other.publisher.interface = "eth0";
  const auto second = RosBus::start(other);
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_TRUE(eventually([&] { return !(*second)->trouble().empty(); }));
  EXPECT_THAT((*second)->trouble(), HasSubstr("this process has the domain on lo already"));
}

TEST_F(RosBusTest, OlderPosesAndThoseBetweenTheRatesBeatsAreNotSaid) {
  config_.rate_hz = 10;
  const auto listener = listen("");
  const auto bus = RosBus::start(config_);
  ASSERT_TRUE(bus) << bus.error().message;
  std::int64_t step = 0;
  ASSERT_TRUE(eventually([&] {  // poses 5 ms apart, each of them with an older one behind it
    ++step;
    (*bus)->publish(numbered_pose(step * 5'000'000));
    (*bus)->publish(numbered_pose(step * 5'000'000 - 50'000'000));
    return heard(*listener, "odom").size() > 10;
  }));
  std::int64_t before_ns = 0;
  for (const Fields& odom : heard(*listener, "odom")) {
    const std::int64_t stamp_ns = std::stoll(odom[kStamp]);
    EXPECT_GE(stamp_ns - before_ns, 100'000'000);
    before_ns = stamp_ns;
  }
}

TEST_F(RosBusTest, ADaemonsOdometryComesAtTheConfiguredRate) {
  const auto listener = listen("");
  const auto daemon = start_daemon("", {"ros.rate_hz=10"});
  constexpr std::size_t kMessages = 21;
  ASSERT_TRUE(eventually([&] { return heard(*listener, "odom").size() >= kMessages; }))
      << daemon->err();
  const auto odoms = heard(*listener, "odom");
  std::vector<std::int64_t> steps_ns;
  for (std::size_t i = 1; i < kMessages; ++i) {
    steps_ns.push_back(std::stoll(odoms[i][kStamp]) - std::stoll(odoms[i - 1][kStamp]));
  }
  std::ranges::nth_element(steps_ns, steps_ns.begin() + kMessages / 2);
  EXPECT_NEAR(static_cast<double>(steps_ns[kMessages / 2]), 100e6, 1e6);  // 30 Hz thinned to 10
  daemon->send_signal(SIGTERM);
  EXPECT_EQ(daemon->wait(std::chrono::seconds{60}), 0) << daemon->err();
}

TEST_F(RosBusTest, TwoDaemonsShareANetworkWithoutMixing) {
  const auto listener1 = listen("dog1");
  const auto listener2 = listen("dog2");
  const auto daemon1 = start_daemon("dog1", {});
  const auto daemon2 = start_daemon("dog2", {});
  ASSERT_TRUE(eventually([&] {
    return heard(*listener1, "odom").size() > 10 && heard(*listener2, "odom").size() > 10 &&
           heard(*listener1, "diagnostic").size() > 1 && heard(*listener1, "writer").size() >= 6;
  })) << daemon1->err()
      << daemon2->err();
  std::vector<std::string> frames1;
  std::vector<std::string> frames2;
  for (const Fields& odom : heard(*listener1, "odom")) {
    frames1.push_back(odom[kFrame]);
  }
  for (const Fields& odom : heard(*listener2, "odom")) {
    frames2.push_back(odom[kFrame]);
  }
  EXPECT_THAT(frames1, Each("odomdog1"));
  EXPECT_THAT(frames2, Each("odomdog2"));
  EXPECT_THAT(heard(*listener1, "diagnostic"), Each(Contains("dog1")));
  std::vector<std::string> topics;
  for (const Fields& writer : heard(*listener1, "writer")) {
    topics.push_back(writer[1]);
  }
  EXPECT_THAT(topics, testing::IsSupersetOf({"rt/dog1/odom", "rt/dog1/tf", "rt/dog1/diagnostics",
                                             "rt/dog2/odom", "rt/dog2/tf", "rt/dog2/diagnostics"}));
}

}  // namespace
}  // namespace geoflow::daemon::bus
