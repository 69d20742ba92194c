#include "geoflow/calibration/imu_intrinsics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

namespace geoflow::calibration {
namespace {

using testing::HasSubstr;

constexpr double kGravity = 9.80665;
constexpr double kPeriodS = 0.005;

/// An IMU with errors as a D435i's: reading = triad * true + bias + noise, and a gyroscope that
/// feels acceleration.
struct FaultyImu {
  Matrix3d triad = Matrix3d::Identity();
  Vector3d accel_bias = Vector3d::Zero();
  Vector3d gyro_bias = Vector3d::Zero();
  Matrix3d per_accel = Matrix3d::Zero();
  double accel_walk = 1e-3;  ///< [m/s^3/sqrt(Hz)]
  double gyro_walk = 1e-4;   ///< [rad/s^2/sqrt(Hz)]

  /// The correction that undoes `triad` but for a rotation: C^T C = (triad triad^T)^-1.
  [[nodiscard]] Matrix3d correction() const {
    const Matrix3d inverse = triad.inverse();
    return Matrix3d{inverse.transpose() * inverse}.llt().matrixU();
  }
};

Vector3d normal3(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return {normal(random), normal(random), normal(random)};
}

FaultyImu random_imu(std::mt19937_64& random) {
  FaultyImu imu;
  std::normal_distribution<double> normal;
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) {
      imu.triad(i, j) += (i == j ? 0.01 : 0.005) * normal(random);
      imu.per_accel(i, j) = 2e-4 * normal(random);
    }
  }
  imu.accel_bias = 0.1 * normal3(random);
  imu.gyro_bias = 5e-3 * normal3(random);
  return imu;
}

/// The recording of an IMU that is laid down with `ups` upwards in turn, for `rest_s` each, and is
/// turned for half a second between.
std::vector<Timed<ImuSample>> laid_down(FaultyImu imu, const std::vector<Vector3d>& ups,
                                        std::mt19937_64& random, double rest_s = 3) {
  constexpr double kWhiteAccel = 1.471e-3;
  constexpr double kWhiteGyro = 2.443e-4;
  constexpr double kTurnS = 0.5;
  std::vector<Timed<ImuSample>> samples;
  const auto say = [&](const Vector3d& accel, const Vector3d& gyro) {
    const double t_s = static_cast<double>(samples.size()) * kPeriodS;
    samples.push_back(
        {.t = HostTime{from_seconds(t_s)},
         .sample = {.accel_mps2 = imu.triad * accel + imu.accel_bias +
                                  kWhiteAccel / std::sqrt(kPeriodS) * normal3(random),
                    .gyro_radps = gyro + imu.gyro_bias + imu.per_accel * accel +
                                  kWhiteGyro / std::sqrt(kPeriodS) * normal3(random)}});
    imu.accel_bias += imu.accel_walk * std::sqrt(kPeriodS) * normal3(random);
    imu.gyro_bias += imu.gyro_walk * std::sqrt(kPeriodS) * normal3(random);
  };
  for (std::size_t pose = 0; pose < ups.size(); ++pose) {
    const Vector3d up = ups[pose].normalized();
    for (double t_s = 0; t_s < rest_s; t_s += kPeriodS) {
      say(kGravity * up, Vector3d::Zero());
    }
    const Vector3d next = ups[(pose + 1) % ups.size()].normalized();
    for (double t_s = 0; t_s < kTurnS; t_s += kPeriodS) {
      const Vector3d between = (up + t_s / kTurnS * (next - up)).normalized();
      say(kGravity * between + 0.5 * normal3(random), Vector3d{1, 0.5, -0.7});
    }
  }
  return samples;
}

/// Down on all sides, on all edges and on all corners.
std::vector<Vector3d> all_round() {
  std::vector<Vector3d> ups;
  for (const double x : {-1.0, 0.0, 1.0}) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      for (const double z : {-1.0, 0.0, 1.0}) {
        if (x != 0 || y != 0 || z != 0) {
          ups.emplace_back(x, y, z);
        }
      }
    }
  }
  return ups;
}

std::string refusal(const std::vector<Vector3d>& ups) {
  std::mt19937_64 random{7};
  const auto samples = laid_down({}, ups, random);
  const auto estimate = estimate_imu_intrinsics(samples, {});
  return estimate ? "accepted" : estimate.error().message;
}

/// Errors of the accelerometer's parameters in their standard deviations.
std::vector<double> errors_in_sigmas(const ImuIntrinsicsEstimate& found, const FaultyImu& truth) {
  const Matrix3d wrong = found.accel.correction - truth.correction();
  const Vector3d bias = found.accel.bias_mps2 - truth.accel_bias;
  const auto sigma = found.accel_covariance.diagonal().cwiseSqrt().eval();
  std::vector<double> errors{wrong(0, 0) / sigma[0], wrong(1, 1) / sigma[1],
                             wrong(2, 2) / sigma[2], wrong(0, 1) / sigma[3],
                             wrong(0, 2) / sigma[4], wrong(1, 2) / sigma[5]};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    errors.push_back(bias[axis] / sigma[6 + axis]);
    errors.push_back((found.gyro.bias_radps[axis] - truth.gyro_bias[axis]) /
                     found.gyro_bias_sigma_radps[axis]);
    for (Eigen::Index by = 0; by < 3; ++by) {
      errors.push_back((found.gyro.per_accel(axis, by) - truth.per_accel(axis, by)) /
                       found.gyro_per_accel_sigma(axis, by));
    }
  }
  return errors;
}

TEST(ImuIntrinsics, AreWithinTheirSigmasOnTwentySeeds) {
  std::size_t total = 0;
  std::size_t within = 0;
  double squares = 0;
  double worst_scale = 0;
  double worst_angle = 0;
  double worst_bias = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random{geoflow::tests::test_seed(0) + seed};
    FaultyImu imu = random_imu(random);
    imu.accel_walk = imu.gyro_walk = 0;  // else there is no one bias that would be the true one
    const auto samples = laid_down(imu, all_round(), random);
    const auto found = estimate_imu_intrinsics(samples, {});
    ASSERT_TRUE(found.has_value()) << found.error().message;
    EXPECT_EQ(found->poses.size(), 26) << seed;
    for (const double error : errors_in_sigmas(*found, imu)) {
      ++total;
      within += std::abs(error) <= 3 ? 1U : 0U;
      squares += error * error;
    }
    const Matrix3d wrong = found->accel.correction - imu.correction();
    const Matrix3d angles = wrong.triangularView<Eigen::StrictlyUpper>();
    worst_scale = std::max(worst_scale, wrong.diagonal().cwiseAbs().maxCoeff());
    worst_angle = std::max(worst_angle, angles.cwiseAbs().maxCoeff());
    worst_bias =
        std::max(worst_bias, (found->accel.bias_mps2 - imu.accel_bias).cwiseAbs().maxCoeff());
  }
  RecordProperty("within_3_sigma", std::to_string(within) + " of " + std::to_string(total));
  RecordProperty("mean_square_in_sigmas", std::to_string(squares / static_cast<double>(total)));
  RecordProperty("worst_scale", std::to_string(worst_scale));
  RecordProperty("worst_angle_rad", std::to_string(worst_angle));
  RecordProperty("worst_bias_mps2", std::to_string(worst_bias));
  EXPECT_GE(within, total * 95 / 100);
  EXPECT_LT(squares / static_cast<double>(total), 1.5);
  EXPECT_LT(worst_scale, 1e-3);
  EXPECT_LT(worst_angle, 0.1 * M_PI / 180);
  EXPECT_LT(worst_bias, 0.02);
}

TEST(ImuIntrinsics, CorrectWhatLengthsTellOfOtherReadings) {
  std::mt19937_64 random{geoflow::tests::test_seed(31)};
  const FaultyImu imu = random_imu(random);  // with biases that wander
  const auto samples = laid_down(imu, all_round(), random);
  const auto found = estimate_imu_intrinsics(samples, {});
  ASSERT_TRUE(found.has_value()) << found.error().message;
  EXPECT_LT(found->rms_after_mps2, 0.02);
  for (int i = 0; i < 100; ++i) {
    const Vector3d truth = kGravity * normal3(random).normalized();
    const Vector3d reading = imu.triad * truth + imu.accel_bias;
    const Vector3d corrected = found->accel.correction * (reading - found->accel.bias_mps2);
    EXPECT_NEAR(corrected.norm(), kGravity, 0.05);
  }
  const auto findings = judge(*found, {});
  EXPECT_EQ(findings.size(), 22);
  EXPECT_EQ(findings.front().verdict, Verdict::kPass);
  for (const Finding& finding : findings) {
    EXPECT_NE(finding.verdict, Verdict::kFail) << finding.name;
  }
}

TEST(ImuIntrinsics, AreRefusedFromTooFewPoses) {
  EXPECT_THAT(refusal({Vector3d::UnitZ(), Vector3d::UnitX(), Vector3d::UnitY()}),
              HasSubstr("lies still 3 times"));
}

TEST(ImuIntrinsics, AreRefusedWithTheOrientationsThatAreMissing) {
  std::vector<Vector3d> ups = all_round();
  std::erase_if(ups, [](const Vector3d& up) { return up.normalized().z() < -0.55; });
  EXPECT_THAT(refusal(ups), HasSubstr("orientations are missing: with z down"));
}

TEST(ImuIntrinsics, AreRefusedFromSidesAlone) {
  std::vector<Vector3d> ups;
  for (int round = 0; round < 2; ++round) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      ups.emplace_back(Vector3d::Unit(axis));
      ups.emplace_back(-Vector3d::Unit(axis));
    }
  }
  EXPECT_THAT(refusal(ups), HasSubstr("tilted between x and y, tilted between y and z"));
}

TEST(ImuIntrinsics, ThatNoMatrixCorrectsFail) {
  std::mt19937_64 random{geoflow::tests::test_seed(32)};
  auto samples = laid_down(random_imu(random), all_round(), random);
  // An axis that bends: no scale and no bias make lengths at rest one.
  for (auto& sample : samples) {
    sample.sample.accel_mps2.x() += 0.03 * std::pow(sample.sample.accel_mps2.x(), 2);
  }
  const auto found = estimate_imu_intrinsics(samples, {});
  ASSERT_TRUE(found.has_value()) << found.error().message;
  const auto findings = judge(*found, {});
  EXPECT_EQ(overall(findings), Verdict::kFail);
  EXPECT_THAT(findings.front().note, HasSubstr("not as long as gravity"));
}

}  // namespace
}  // namespace geoflow::calibration
