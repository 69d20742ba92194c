#include "geoflow/timesync/doorbell.hpp"

#include <chrono>
#include <cstdint>
#include <thread>

#include <gtest/gtest.h>
#include <poll.h>

#include "geoflow/timesync/spsc_ring.hpp"

namespace geoflow::timesync::tests {
namespace {

using Wake = Doorbell::Wake;
using std::chrono::milliseconds;

bool is_readable(int fd) {
  pollfd watched{.fd = fd, .events = POLLIN, .revents = 0};
  return ::poll(&watched, 1, 0) == 1;
}

TEST(Doorbell, RingsOnceForAnyNumberOfRings) {
  auto bell = Doorbell::create();
  ASSERT_TRUE(bell);
  EXPECT_EQ(bell->wait(milliseconds{0}), Wake::kTimeout);
  bell->ring();
  bell->ring();
  EXPECT_TRUE(is_readable(bell->fd()));
  EXPECT_EQ(bell->wait(), Wake::kRung);
  EXPECT_FALSE(is_readable(bell->fd()));
  EXPECT_EQ(bell->wait(milliseconds{1}), Wake::kTimeout);
  bell->ring();
  EXPECT_EQ(bell->wait(milliseconds{0}), Wake::kRung);
}

TEST(Doorbell, StopIsFinal) {
  auto bell = Doorbell::create();
  ASSERT_TRUE(bell);
  bell->stop();
  EXPECT_TRUE(bell->stopped());
  bell->clear();
  EXPECT_TRUE(is_readable(bell->fd()));
  EXPECT_EQ(bell->wait(), Wake::kStopped);
  bell->ring();
  EXPECT_EQ(bell->wait(), Wake::kStopped);
}

TEST(Doorbell, StopWakesAWaiter) {
  auto bell = Doorbell::create();
  ASSERT_TRUE(bell);
  Wake wake = Wake::kTimeout;
  std::jthread waiter{[&] { wake = bell->wait(); }};
  bell->stop();
  waiter.join();
  EXPECT_EQ(wake, Wake::kStopped);
}

/// Each push is followed by a ring; the consumer only sleeps when it found the ring empty. A lost
/// ring would hang.
TEST(Doorbell, LosesNoRingBetweenTwoThreads) {
  constexpr std::uint64_t kValues = 50'000;
  constexpr milliseconds kLost{5000};
  auto bell = Doorbell::create();
  ASSERT_TRUE(bell);
  SpscRing<std::uint64_t> ring{16};
  const std::jthread producer{[&] {
    for (std::uint64_t i = 0; i < kValues; ++i) {
      while (!ring.try_push(i)) {
        std::this_thread::yield();
      }
      bell->ring();
    }
  }};
  std::uint64_t received = 0;
  bool lost = false;
  while (received < kValues && !lost) {
    while (ring.try_pop()) {
      ++received;
    }
    lost = received < kValues && bell->wait(kLost) == Wake::kTimeout;
  }
  EXPECT_FALSE(lost);
  while (ring.try_pop()) {  // lets the producer end
  }
  EXPECT_EQ(received, kValues);
}

}  // namespace
}  // namespace geoflow::timesync::tests
