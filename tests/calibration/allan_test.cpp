#include "geoflow/calibration/allan.hpp"

#include <array>
#include <cstddef>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace geoflow::calibration {
namespace {

TEST(Allan, OfNistsTenSamplesIsWhatTheHandbookSays) {
  // NIST SP 1065, section 12.4: nine frequency values of the classic 1976 data set (E. Ferre-Pikal
  // and others), and their overlapping Allan deviations.
  const std::array<double, 9> values{892, 809, 823, 798, 671, 644, 883, 903, 677};
  const std::array<std::size_t, 2> factors{1, 2};
  const auto points = overlapping_allan(values, 1, factors);
  ASSERT_EQ(points.size(), 2);
  EXPECT_NEAR(points[0].deviation, 91.22945, 1e-5);
  EXPECT_NEAR(points[1].deviation, 85.95287, 1e-5);
  EXPECT_EQ(points[0].terms, 8);
  EXPECT_EQ(points[1].terms, 6);
}

TEST(Allan, DoesNotSeeAConstantAndScalesWithTheSignal) {
  const std::vector<double> signal{1, 3, 2, 5, 4, 4, 1, 0};
  std::vector<double> shifted;
  for (const double value : signal) {
    shifted.push_back(1e6 + 3 * value);
  }
  const std::array<std::size_t, 3> factors{1, 2, 4};
  const auto plain = overlapping_allan(signal, 0.5, factors);
  const auto moved = overlapping_allan(shifted, 0.5, factors);
  ASSERT_EQ(plain.size(), 3);
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_NEAR(moved[i].deviation, 3 * plain[i].deviation, 1e-8);
  }
  EXPECT_DOUBLE_EQ(plain[2].tau_s, 2);
}

TEST(Allan, LeavesOutFactorsThatAreTooLong) {
  const std::array<double, 5> signal{1, 2, 1, 2, 1};
  const std::array<std::size_t, 3> factors{0, 2, 3};
  EXPECT_EQ(overlapping_allan(signal, 1, factors).size(), 1);
}

TEST(Allan, FactorsAscendWithoutRepeats) {
  EXPECT_THAT(allan_factors(20, 1), testing::ElementsAre(1, 2, 4, 8, 16));
  EXPECT_THAT(allan_factors(8, 2), testing::ElementsAre(1, 2, 3, 4, 6, 8));
}

}  // namespace
}  // namespace geoflow::calibration
