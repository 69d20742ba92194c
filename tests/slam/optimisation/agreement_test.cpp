#include "optimisation/agreement.hpp"

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

/// A belief of which millimetres and milliradians are known, and what is measured of the same.
namespace geoflow::slam {
namespace {

Matrix6d covariance(double sigma_rad, double sigma_m) {
  Vector6d variance;
  variance << Vector3d::Constant(sigma_rad * sigma_rad), Vector3d::Constant(sigma_m * sigma_m);
  return variance.asDiagonal();
}

class AgreementTest : public testing::Test {
 protected:
  /// What is left of a measurement that is `off` the belief's mean.
  void leave(const Vector6d& off) {
    const Vector6d b = -h_ * off;
    const Matrix6d N = agreeing(h_, b, covariance(1e-3, 2e-3));
    left_ = N.transpose() * h_ * N;
    b_left_ = N.transpose() * b;
  }
  /// Each direction is known differently, so that it is clear which they are.
  Matrix6d h_ = [] {
    Vector6d sigma;
    sigma << 0.5e-3, 1e-3, 2e-3, 1e-3, 2e-3, 4e-3;
    return Matrix6d{sigma.cwiseAbs2().cwiseInverse().asDiagonal()};
  }();
  Matrix6d left_;
  Vector6d b_left_;
};

TEST_F(AgreementTest, WhatAgreesIsLeftAsItIs) {
  Vector6d off;
  off << 1e-3, 0, -2e-3, 2e-3, -3e-3, 5e-3;
  leave(off);
  EXPECT_TRUE(left_.isApprox(h_, 1e-9));
  EXPECT_TRUE(b_left_.isApprox(-h_ * off, 1e-9));
}

TEST_F(AgreementTest, WhatContradictsSaysNothingOfThatDirectionAndAllOfTheOthers) {
  Vector6d off = Vector6d::Zero();
  off[3] = 1e-3;
  off[5] = 0.05;  // someone walks towards the camera
  leave(off);
  const Vector6d b = -h_ * off;
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(left_(i, i), i == 5 ? 0 : h_(i, i), 1e-6 * h_(i, i)) << i;
    EXPECT_NEAR(b_left_[i], i == 5 ? 0 : b[i], 1e-6 * b.norm()) << i;
  }
}

TEST_F(AgreementTest, AnOpenDirectionContradictsNothing) {
  h_(5, 5) = 0;
  leave(Vector6d::Unit(5));
  EXPECT_TRUE(left_.isApprox(h_, 1e-9));
}

TEST_F(AgreementTest, WhatIsNoCovarianceIsNoBelief) {
  const Vector6d b = Vector6d::Constant(1e9);
  EXPECT_TRUE(agreeing(h_, b, -Matrix6d::Identity()).isIdentity(0));
}

}  // namespace
}  // namespace geoflow::slam
