#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/types.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/time.hpp"

#include "geoflow_client.h"
#include "geoflowd_fixture.hpp"
#include "process.hpp"
#include "simulated_walk.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using tests::Process;

constexpr auto kWatchdog = seconds{10};  // as in the service's unit

/// What a process holds.
struct Usage {
  long memory_kib = 0;  ///< resident
  long descriptors = 0;
  long threads = 0;
};

Usage usage_of(pid_t process) {
  const auto folder = std::filesystem::path{"/proc"} / std::to_string(process);
  const auto count = [&](const char* name) {
    return static_cast<long>(std::distance(std::filesystem::directory_iterator{folder / name}, {}));
  };
  Usage usage{.descriptors = count("fd"), .threads = count("task")};
  std::ifstream status{folder / "status"};
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) {
      usage.memory_kib = std::stol(line.substr(line.find_first_of("0123456789")));
    }
  }
  return usage;
}

/// The medians of one half of the samples.
Usage median(std::vector<Usage> samples) {
  const auto of = [&](long Usage::* member) {
    const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
    std::ranges::nth_element(samples, middle, {}, member);
    return (*middle).*member;
  };
  return {.memory_kib = of(&Usage::memory_kib),
          .descriptors = of(&Usage::descriptors),
          .threads = of(&Usage::threads)};
}

/// $GEOFLOW_ENDURANCE_S, or what CI has time for.
Duration endurance() {
  const char* asked =
      std::getenv("GEOFLOW_ENDURANCE_S");  // NOLINT(concurrency-mt-unsafe): no other thread
  return seconds{asked == nullptr ? 120 : std::strtol(asked, nullptr, 10)};
}

class GeoflowdEndurance : public GeoflowdService {
 protected:
  /// A client that comes for one pose and one image, and goes; the newest reset_counter it saw.
  [[nodiscard]] std::uint32_t visit() const {
    const std::string socket = pose_.string();
    const geoflow_options options{
        .socket = socket.c_str(),
        .name = "visitor",
        .want = GEOFLOW_WANT_POSE | GEOFLOW_WANT_COLOR | GEOFLOW_WANT_DEPTH,
        .max_rate_hz = 0};
    geoflow_client client{};
    EXPECT_EQ(geoflow_connect(&client, &options), 0) << &client.error[0];
    std::uint32_t resets = 0;
    bool pose = false;
    bool image = false;
    geoflow_event event{};
    while (!(pose && image) && geoflow_next(&client, &event, 10'000) == GEOFLOW_RECEIVED) {
      pose = pose || event.type == GEOFLOW_POSE;
      image = image || event.type == GEOFLOW_FRAME;
      resets = event.type == GEOFLOW_POSE ? event.pose.reset_counter : resets;
    }
    EXPECT_TRUE(pose && image) << &client.error[0];
    geoflow_close(&client);
    return resets;
  }

  /// One sample each time that the watchdog was fed, until `end`.
  [[nodiscard]] std::vector<Usage> watch(const Process& process, HostTime end) {
    std::vector<Usage> samples;
    while (HostClock::now() < end && !HasFailure()) {
      EXPECT_TRUE(manager_.wait_for("WATCHDOG=1", kWatchdog)) << process.err();
      rounds_ = visit();
      EXPECT_EQ(status().at("pose_socket").at("cut_off"), 0);
      samples.push_back(usage_of(process.pid()));
    }
    return samples;
  }

  std::uint32_t rounds_ = 0;  // of the recording
};

TEST_F(GeoflowdEndurance, ReplaysInALoopTakeNoMoreMemoryDescriptorsOrThreadsAndFeedTheWatchdog) {
  const auto bag = tests::simulate_walk(path(), "office", 1, 5);
  ASSERT_FALSE(bag.empty());
  const std::string period =
      "WATCHDOG_USEC=" + std::to_string(std::chrono::microseconds{kWatchdog}.count());
  const Process process{daemon({period}, {"--replay", bag.string(), "--fast", "--loop"}),
                        log("daemon")};
  ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
  const HostTime begin = HostClock::now();
  (void)watch(process, begin + endurance() / 4);  // until all has been touched once
  constexpr std::uint32_t kWarmRounds = 60;  // for so many, memory that is used again still grows
  while (rounds_ < kWarmRounds && !HasFailure()) {
    (void)watch(process, HostClock::now() + seconds{1});
  }
  const std::vector<Usage> samples = watch(process, HostClock::now() + endurance() * 3 / 4);
  ASSERT_GE(samples.size(), 4U);
  const auto half = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  const std::vector<Usage> before{samples.begin(), half};
  const Usage first = median(before);
  const Usage second = median({half, samples.end()});
  const long most_descriptors = std::ranges::max(before, {}, &Usage::descriptors).descriptors;
  const long most_threads = std::ranges::max(before, {}, &Usage::threads).threads;
  std::cout << rounds_ << " rounds; medians: " << first.memory_kib << " -> " << second.memory_kib
            << " KiB, " << first.descriptors << " (at most " << most_descriptors << ") -> "
            << second.descriptors << " descriptors, " << first.threads << " (at most "
            << most_threads << ") -> " << second.threads << " threads\n";
  // One thread was added once in 1774 rounds, and once in 40 on a busy machine; which one is not
  // known yet. What a round does not give back adds up to more.
  constexpr long kLateThreads = 1;
  constexpr long kSpreadKib = 2048;  // 0.2 MiB was seen in 199 rounds
  EXPECT_LE(second.memory_kib, first.memory_kib + kSpreadKib);
  EXPECT_LE(second.descriptors, first.descriptors);
  EXPECT_LE(second.threads, first.threads + kLateThreads);
}

}  // namespace
}  // namespace geoflow::daemon
