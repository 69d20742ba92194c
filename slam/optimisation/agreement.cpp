#include "optimisation/agreement.hpp"

#include <Eigen/Cholesky>

#include "geoflow/hal/geometry.hpp"

#include "optimisation/matrix6.hpp"

namespace geoflow::slam {

Matrix6d agreeing(const Matrix6d& H, const Vector6d& b, const Matrix6d& covariance) {
  constexpr double kChi2Of1At9999Of10000 = 15.1;
  const Eigen::LLT<Matrix6d> root{covariance};
  if (root.info() != Eigen::Success) {
    return Matrix6d::Identity();
  }
  const Matrix6d L = root.matrixL();
  const SymmetricEigen measured = symmetric_eigen(L.transpose() * H * L);
  const Vector6d gradient = measured.directions.transpose() * (L.transpose() * b);
  Matrix6d kept = Matrix6d::Identity();
  for (int i = 0; i < 6; ++i) {
    // The measurement says -gradient / lambda with the variance 1 / lambda, the belief 0 with 1.
    const double lambda = measured.eigenvalues[i];
    if (gradient[i] * gradient[i] > kChi2Of1At9999Of10000 * lambda * (lambda + 1)) {
      const Vector6d direction = measured.directions.col(i);
      kept -= direction * direction.transpose();
    }
  }
  return L * kept * root.matrixL().solve(Matrix6d::Identity());
}

}  // namespace geoflow::slam
