
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "tests/support/data.hpp"

#include "clock_run.hpp"
#include "random_clock.hpp"

namespace geoflow::timesync::tests {
namespace {

/// What may be expected of a distribution, in units of its scale.
struct Expectation {
  Jitter jitter;
  double mean_error = 0;
  double worst_error = 0;
  double mean_bound = 0;
};

/// A sanitizer has nothing to gain from hundreds of runs of one thread.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr int kRuns = 20;
#else
constexpr int kRuns = 200;
#endif

class RandomClocks : public ::testing::TestWithParam<Expectation> {};

/// Random offset, drift and rate; errors in units of the jitter, per run and as means over hundreds
/// of runs.
TEST_P(RandomClocks, ErrorsStayWithinUnitsOfJitterAndTheBoundCovers) {
  constexpr double kDurationS = 60;
  constexpr double kWarmUpS = 5;
  const Expectation& expected = GetParam();
  const std::uint64_t seed = ::geoflow::tests::test_seed(1);
  Random random{seed};
  Statistics mean;
  for (int i = 0; i < kRuns; ++i) {
    const RandomClock clock = draw_clock(random, true);
    Model model{kWrapping};
    const auto judged = run(model, clock, expected.jitter, kDurationS, random);
    const auto skip = static_cast<std::size_t>(kWarmUpS * kSecondNs / clock.period_ns);
    const Statistics one = statistics(judged, skip);
    const double worst = one.worst_ns / expected.jitter.scale_ns;
    EXPECT_LE(worst, expected.worst_error) << "run " << i << " of seed " << seed;
    mean.worst_ns = std::max(mean.worst_ns, worst);
    mean.mean_abs_ns += one.mean_abs_ns / expected.jitter.scale_ns / kRuns;
    mean.mean_bound_ns += one.mean_bound_ns / expected.jitter.scale_ns / kRuns;
    mean.covered += one.covered / kRuns;
    EXPECT_EQ(model.counters().jumps, 0U) << "run " << i << " of seed " << seed;
  }
  RecordProperty("mean_error", std::to_string(mean.mean_abs_ns));
  RecordProperty("worst_error", std::to_string(mean.worst_ns));
  RecordProperty("mean_bound", std::to_string(mean.mean_bound_ns));
  RecordProperty("covered", std::to_string(mean.covered));
  EXPECT_LE(mean.mean_abs_ns, expected.mean_error);
  EXPECT_LE(mean.mean_bound_ns, expected.mean_bound);
  EXPECT_GE(mean.covered, 0.99);
}

// A tenth of the queueing samples come 20 units late: each is given its lateness as bound, which
// makes a mean of 2. With very little jitter the rate, still being learnt after 5 s, is worth up to
// one unit.
INSTANTIATE_TEST_SUITE_P(
    Jitters, RandomClocks,
    ::testing::Values(Expectation{exponential_jitter(0.5 * kMsInNs), 0.05, 0.5, 0.5},
                      Expectation{uniform_jitter(0.5 * kMsInNs), 0.05, 0.5, 0.5},
                      Expectation{half_normal_jitter(0.5 * kMsInNs), 0.05, 0.5, 0.5},
                      Expectation{gamma_jitter(0.5 * kMsInNs), 0.15, 0.5, 0.5},
                      Expectation{heavy_jitter(0.5 * kMsInNs), 0.05, 0.5, 0.5},
                      Expectation{queueing_jitter(0.5 * kMsInNs), 0.05, 0.5, 2.5},
                      Expectation{exponential_jitter(0.05 * kMsInNs), 0.1, 1.5, 0.8},
                      Expectation{exponential_jitter(4.0 * kMsInNs), 0.05, 0.5, 0.5}),
    [](const auto& tested) {
      std::string name = tested.param.jitter.name + "_" +
                         std::to_string(static_cast<int>(tested.param.jitter.scale_ns / 1e3)) +
                         "us";
      std::ranges::replace(name, ' ', '_');
      return name;
    });

}  // namespace
}  // namespace geoflow::timesync::tests
