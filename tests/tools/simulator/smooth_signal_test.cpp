#include "geoflow/tools/simulator/smooth_signal.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "geoflow/tools/simulator/random_stream.hpp"

namespace geoflow::simulator {
namespace {

TEST(SmoothSignal, DerivativesAreExactAndContinuous) {
  const SmoothSignal signal = SmoothSignal::noise(RandomStream{3, "test"}, 0.4, 20);
  constexpr double kStep = 1e-5;
  for (double t_s = 0; t_s < 20; t_s += 0.0371) {
    const Jet at = signal.at(t_s);
    const Jet before = signal.at(t_s - kStep);
    const Jet after = signal.at(t_s + kStep);
    EXPECT_NEAR((after.value - before.value) / (2 * kStep), at.rate, 1e-7);
    EXPECT_NEAR((after.rate - before.rate) / (2 * kStep), at.accel, 1e-6);
  }
  for (int control = 1; control < 40; ++control) {
    constexpr double kAside = 1e-9;
    EXPECT_NEAR(signal.at(0.4 * control - kAside).accel, signal.at(0.4 * control + kAside).accel,
                1e-5);
  }
}

TEST(SmoothSignal, ReproducesLinesAndHoldsAtItsEnds) {
  const SmoothSignal line{0.5, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}};
  for (double t_s = 1.6; t_s < 4.4; t_s += 0.13) {
    EXPECT_NEAR(line.at(t_s).value, 2 * t_s, 1e-12);
    EXPECT_NEAR(line.at(t_s).rate, 2, 1e-12);
  }
  EXPECT_DOUBLE_EQ(line.at(-100).value, 0);
  EXPECT_DOUBLE_EQ(line.at(1e9).value, 12);
}

TEST(SmoothSignal, JetsFollowTheRulesOfDifferentiation) {
  // sin(t^2) cos(3 t) at t = 0.7.
  const double t = 0.7;
  const Jet time{.value = t, .rate = 1};
  const Jet product = sin(time * time) * cos(3 * time);
  const auto value = [](double x) { return std::sin(x * x) * std::cos(3 * x); };
  constexpr double kStep = 1e-4;
  EXPECT_DOUBLE_EQ(product.value, value(t));
  EXPECT_NEAR(product.rate, (value(t + kStep) - value(t - kStep)) / (2 * kStep), 1e-6);
  EXPECT_NEAR(product.accel, (value(t + kStep) - 2 * value(t) + value(t - kStep)) / (kStep * kStep),
              1e-5);
}

TEST(RandomStream, GivesNormalNumbersThatDependOnSeedNameAndIndexOnly) {
  RandomStream stream{7, "noise"};
  double sum = 0;
  double squares = 0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const double x = stream.normal();
    sum += x;
    squares += x * x;
  }
  // Within four standard errors.
  EXPECT_NEAR(sum / kCount, 0, 4 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount, 1, 4 * std::sqrt(2.0 / kCount));
  EXPECT_EQ(RandomStream(7, "noise").at(5).uniform(), stream.at(5).uniform());
  EXPECT_NE(RandomStream(7, "noise").at(5).uniform(), stream.at(6).uniform());
  EXPECT_NE(RandomStream(7, "noise").uniform(), RandomStream(7, "other").uniform());
  EXPECT_NE(RandomStream(7, "noise").uniform(), RandomStream(8, "noise").uniform());
}

}  // namespace
}  // namespace geoflow::simulator
