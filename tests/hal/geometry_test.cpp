#include "geoflow/hal/geometry.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/data.hpp"

namespace geoflow {
namespace {

/// Awkward tangents: zero, tiny, near pi, pure rotation and translation, and random ones.
std::vector<Vector6d> tangents() {
  using std::numbers::pi;
  std::vector<Vector6d> all;
  for (const double angle :
       {0.0, 1e-12, 1e-7, 9e-5, 1.1e-4, 1e-3, 9e-3, 1.1e-2, 0.5, 2.0, pi - 1e-6}) {
    for (const Vector3d& axis :
         {Vector3d{1, 0, 0}, Vector3d{0, -1, 0}, Vector3d{1, 2, -3}.normalized().eval()}) {
      for (const Vector3d& rho : {Vector3d{0, 0, 0}, Vector3d{1, -2, 0.5}, Vector3d{1e-6, 0, 0}}) {
        Vector6d xi;
        xi << angle * axis, rho;
        all.push_back(xi);
      }
    }
  }
  std::mt19937_64 random{tests::test_seed(1)};
  std::uniform_real_distribution<double> uniform{-1.5, 1.5};
  for (int i = 0; i < 50; ++i) {
    Vector6d xi;
    for (double& value : xi) {
      value = uniform(random);
    }
    all.push_back(xi);
  }
  return all;
}

double distance(const SE3& a, const SE3& b) {
  return (a.matrix() - b.matrix()).norm();
}

TEST(SE3, LogInvertsExp) {
  for (const Vector6d& xi : tangents()) {
    EXPECT_LT((SE3::exp(xi).log() - xi).norm(), 1e-8) << xi.transpose();
  }
}

TEST(SE3, IsAGroupThatActsOnPoints) {
  const std::vector<Vector6d> all = tangents();
  const Vector3d point{0.3, -2, 4};
  for (std::size_t i = 0; i + 2 < all.size(); ++i) {
    const SE3 a = SE3::exp(all[i]);
    const SE3 b = SE3::exp(all[i + 1]);
    const SE3 c = SE3::exp(all[i + 2]);
    EXPECT_LT(distance((a * b) * c, a * (b * c)), 1e-12);
    EXPECT_LT(distance(a * a.inverse(), SE3{}), 1e-12);
    EXPECT_LT(((a * b) * point - a * (b * point)).norm(), 1e-12);
    EXPECT_LT(((a.matrix() * point.homogeneous()).head<3>() - a * point).norm(), 1e-12);
  }
}

TEST(SE3, AdjointMovesATangentAcross) {
  const std::vector<Vector6d> all = tangents();
  for (std::size_t i = 0; i + 1 < all.size(); ++i) {
    const SE3 T = SE3::exp(all[i]);
    const Vector6d xi = 0.3 * all[i + 1];
    EXPECT_LT(distance(T * SE3::exp(xi) * T.inverse(), SE3::exp(T.adjoint() * xi)), 1e-10);
  }
}

TEST(SE3, RightJacobianMatchesDifferences) {
  constexpr double kStep = 1e-6;
  for (const Vector6d& xi : tangents()) {
    const Matrix6d J = SE3::right_jacobian(xi);
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = kStep * Vector6d::Unit(k);
      const Vector6d forward = (SE3::exp(xi).inverse() * SE3::exp(xi + step)).log();
      const Vector6d backward = (SE3::exp(xi).inverse() * SE3::exp(xi - step)).log();
      EXPECT_LT(((forward - backward) / (2 * kStep) - J.col(k)).norm(), 1e-6)
          << xi.transpose() << " column " << k;
    }
    EXPECT_LT((J * SE3::right_jacobian_inverse(xi) - Matrix6d::Identity()).norm(), 1e-9)
        << xi.transpose();
  }
}

TEST(SE3, LogTakesTheShortWayForEitherSignOfTheQuaternion) {
  const Eigen::Quaterniond q = so3::exp({0.1, 0.2, -0.3});
  const Eigen::Quaterniond minus_q{-q.w(), -q.x(), -q.y(), -q.z()};
  EXPECT_LT((so3::log(q) - so3::log(minus_q)).norm(), 1e-15);
  const Eigen::Quaterniond tiny = so3::exp({1e-9, 0, 0});
  const Eigen::Quaterniond minus_tiny{-tiny.w(), -tiny.x(), -tiny.y(), -tiny.z()};
  EXPECT_NEAR(so3::log(minus_tiny).x(), 1e-9, 1e-20);
}

TEST(SE3, InterpolatesAlongTheGeodesic) {
  const SE3 a = SE3::exp((Vector6d() << 0.1, 0.2, 0.3, 1, 2, 3).finished());
  const SE3 b = SE3::exp((Vector6d() << -0.4, 0.2, 1.0, 0, 2, -3).finished());
  EXPECT_LT(distance(SE3::interpolate(a, b, 0), a), 1e-12);
  EXPECT_LT(distance(SE3::interpolate(a, b, 1), b), 1e-12);
  const SE3 half = SE3::interpolate(a, b, 0.5);
  EXPECT_LT(distance(a.inverse() * half, half.inverse() * b), 1e-12);
}

}  // namespace
}  // namespace geoflow
