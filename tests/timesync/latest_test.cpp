#include "geoflow/timesync/latest.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <thread>

#include <gtest/gtest.h>

namespace geoflow::timesync::tests {
namespace {

TEST(Latest, IsEmptyUntilTheFirstStore) {
  Latest<int> latest;
  EXPECT_EQ(latest.take_new(), std::nullopt);
  EXPECT_EQ(latest.load(), std::nullopt);
  latest.store(7);
  EXPECT_EQ(latest.load(), 7);
}

TEST(Latest, GivesTheNewestAndOnlyOnceAsNew) {
  Latest<int> latest;
  latest.store(1);
  latest.store(2);
  latest.store(3);
  EXPECT_EQ(latest.take_new(), 3);
  EXPECT_EQ(latest.take_new(), std::nullopt);
  EXPECT_EQ(latest.load(), 3);
  latest.store(4);
  EXPECT_EQ(latest.load(), 4);
}

/// A value whose words must all agree: a torn read would mix two.
using Wide = std::array<std::uint64_t, 32>;

TEST(Latest, NeverTearsAndNeverGoesBackBetweenTwoThreads) {
  constexpr std::uint64_t kStores = 200'000;
  Latest<Wide> latest;
  const std::jthread writer{[&latest] {
    for (std::uint64_t i = 1; i <= kStores; ++i) {
      Wide value;
      value.fill(i);
      latest.store(value);
    }
  }};
  std::uint64_t last = 0;
  while (last < kStores) {
    const auto value = latest.take_new();
    if (!value) {
      std::this_thread::yield();
      continue;
    }
    for (const std::uint64_t word : *value) {
      ASSERT_EQ(word, value->front());
    }
    ASSERT_GT(value->front(), last);
    last = value->front();
  }
}

}  // namespace
}  // namespace geoflow::timesync::tests
