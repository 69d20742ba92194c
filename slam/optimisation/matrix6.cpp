#include "optimisation/matrix6.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {

Matrix6d inverse(const Matrix6d& matrix) {
  return matrix.inverse();
}

SymmetricEigen symmetric_eigen(const Matrix6d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver{matrix};
  return {.eigenvalues = solver.eigenvalues(), .directions = solver.eigenvectors()};
}

}  // namespace geoflow::slam
