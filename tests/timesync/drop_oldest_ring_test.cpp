#include "geoflow/timesync/drop_oldest_ring.hpp"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <thread>

#include <gtest/gtest.h>

#include "counted.hpp"

namespace geoflow::timesync::tests {
namespace {

TEST(DropOldestRing, GivesUpTheOldestForTheNew) {
  DropOldestRing<int> ring{3};
  for (int i = 0; i < 10; ++i) {
    ring.push(i);
  }
  EXPECT_EQ(ring.dropped(), 7U);
  EXPECT_EQ(ring.try_pop(), 7);
  EXPECT_EQ(ring.try_pop(), 8);
  EXPECT_EQ(ring.try_pop(), 9);
  EXPECT_EQ(ring.try_pop(), std::nullopt);
}

TEST(DropOldestRing, DropsNothingWhileThereIsRoom) {
  DropOldestRing<int> ring{2};
  for (int i = 0; i < 100; ++i) {
    ring.push(i);
    ring.push(i + 1);
    EXPECT_EQ(ring.try_pop(), i);
    EXPECT_EQ(ring.try_pop(), i + 1);
  }
  EXPECT_EQ(ring.dropped(), 0U);
}

TEST(DropOldestRing, DestroysExactlyWhatItConstructed) {
  {
    DropOldestRing<Counted> ring{5};
    for (std::uint64_t i = 0; i < 32; ++i) {
      ring.push(Counted{i});
      if (i % 4 == 0) {
        (void)ring.try_pop();
      }
    }
    EXPECT_EQ(Counted::alive(), 5);
  }
  EXPECT_EQ(Counted::alive(), 0);
}

struct Outcome {
  std::uint64_t received = 0;
  std::uint64_t last = 0;
  bool ordered = true;
};

/// Takes until the producer is done and the ring is empty.
Outcome drain(DropOldestRing<Counted>& ring, const std::atomic<bool>& done,
              std::uint64_t pause_every) {
  Outcome outcome;
  for (;;) {
    const bool finished = done.load(std::memory_order_acquire);
    const auto value = ring.try_pop();
    if (value) {
      outcome.ordered = outcome.ordered && value->value() > outcome.last;
      outcome.last = value->value();
      ++outcome.received;
    } else if (finished) {
      return outcome;
    }
    if (!value || outcome.received % pause_every == 0) {
      std::this_thread::yield();
    }
  }
}

/// Every element is received or counted as dropped, in order, the last one always received: at
/// small and larger capacities, with a slow and a quick consumer.
TEST(DropOldestRing, TwoThreadsAccountForEveryElement) {
  constexpr std::uint64_t kValues = 100'000;
  for (const std::size_t capacity : {1U, 2U, 8U}) {
    for (const std::uint64_t pause_every : {1U, 100U}) {
      DropOldestRing<Counted> ring{capacity};
      std::atomic<bool> done = false;
      const std::jthread producer{[&] {
        for (std::uint64_t i = 1; i <= kValues; ++i) {
          ring.push(Counted{i});
        }
        done.store(true, std::memory_order_release);
      }};
      const Outcome outcome = drain(ring, done, pause_every);
      EXPECT_TRUE(outcome.ordered);
      EXPECT_EQ(outcome.received + ring.dropped(), kValues);
    }
  }
  EXPECT_EQ(Counted::alive(), 0);
}

}  // namespace
}  // namespace geoflow::timesync::tests
