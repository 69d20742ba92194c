#include "server/token_bucket.hpp"

#include <chrono>
#include <limits>

#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {
namespace {

constexpr HostTime kStart{std::chrono::hours{100}};

TEST(RateLimit, LetsEveryThingThroughWithoutARate) {
  for (const double none : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                            std::numeric_limits<double>::infinity()}) {
    RateLimit limit{none};
    EXPECT_TRUE(limit.due(kStart)) << none;
    EXPECT_TRUE(limit.due(kStart)) << none;
  }
}

TEST(RateLimit, KeepsItsPhaseThroughJitter) {
  using std::chrono::milliseconds;
  RateLimit limit{10};
  EXPECT_TRUE(limit.due(kStart));
  EXPECT_FALSE(limit.due(kStart + milliseconds{70}));
  EXPECT_TRUE(limit.due(kStart + milliseconds{80}));
  EXPECT_FALSE(limit.due(kStart + milliseconds{170}));
  EXPECT_TRUE(limit.due(kStart + milliseconds{200}));
}

// What bytes that are no number a client meant may come to.
TEST(RateLimit, ARateNextToNothingIsOneThingADay) {
  for (const double tiny : {1e-9, 1e-305, std::numeric_limits<double>::denorm_min()}) {
    RateLimit limit{tiny};
    EXPECT_TRUE(limit.due(kStart)) << tiny;
    EXPECT_FALSE(limit.due(kStart + std::chrono::hours{17})) << tiny;
    EXPECT_TRUE(limit.due(kStart + std::chrono::hours{24})) << tiny;
  }
}

}  // namespace
}  // namespace geoflow::daemon
