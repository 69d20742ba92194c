#include "geoflow/timesync/spsc_ring.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "counted.hpp"

namespace geoflow::timesync::tests {
namespace {

TEST(SpscRing, IsFirstInFirstOutAndRefusesWhenFull) {
  SpscRing<int> ring{4};
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(ring.try_push(i));
  }
  EXPECT_FALSE(ring.try_push(4));
  EXPECT_EQ(ring.size(), 4U);
  EXPECT_EQ(ring.try_pop(), 0);
  EXPECT_TRUE(ring.try_push(4));
  for (int i = 1; i <= 4; ++i) {
    EXPECT_EQ(ring.try_pop(), i);
  }
  EXPECT_EQ(ring.try_pop(), std::nullopt);
}

TEST(SpscRing, RoundsItsCapacityUp) {
  EXPECT_EQ(SpscRing<int>{0}.capacity(), 1U);
  EXPECT_EQ(SpscRing<int>{5}.capacity(), 8U);
}

TEST(SpscRing, LeavesAMoveOnlyValueWithTheCallerWhenFull) {
  SpscRing<std::unique_ptr<int>> ring{1};
  EXPECT_TRUE(ring.try_push(std::make_unique<int>(1)));
  auto second = std::make_unique<int>(2);
  EXPECT_FALSE(ring.try_push(std::move(second)));
  // NOLINTBEGIN(bugprone-use-after-move,clang-analyzer-cplusplus.Move): a refusal moves nothing
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(*second, 2);
  // NOLINTEND(bugprone-use-after-move,clang-analyzer-cplusplus.Move)
}

TEST(SpscRing, DestroysExactlyWhatItConstructed) {
  {
    SpscRing<Counted> ring{8};
    for (std::uint64_t i = 0; i < 20; ++i) {
      (void)ring.try_push(Counted{i});
      if (i % 3 == 0) {
        (void)ring.try_pop();
      }
    }
    EXPECT_EQ(Counted::alive(), static_cast<std::int64_t>(ring.size()));
  }
  EXPECT_EQ(Counted::alive(), 0);
}

TEST(SpscRing, TwoThreadsLoseNothingAndKeepTheOrder) {
  constexpr std::uint64_t kValues = 200'000;
  {
    SpscRing<Counted> ring{64};
    const std::jthread producer{[&ring] {
      for (std::uint64_t i = 0; i < kValues; ++i) {
        while (!ring.try_push(Counted{i})) {
          std::this_thread::yield();
        }
      }
    }};
    for (std::uint64_t expected = 0; expected < kValues;) {
      if (const auto value = ring.try_pop()) {
        ASSERT_EQ(value->value(), expected);
        ++expected;
      } else {
        std::this_thread::yield();
      }
    }
  }
  EXPECT_EQ(Counted::alive(), 0);
}

}  // namespace
}  // namespace geoflow::timesync::tests
