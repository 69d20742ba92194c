#pragma once

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {

/// Of a 6 x 6 matrix that has one: of a covariance its information, and the other way round. Here,
/// and not by Eigen at each place, as its decompositions take the compiler seconds for each source.
/// Thread-safe, as all of this header.
[[nodiscard]] Matrix6d inverse(const Matrix6d& matrix);

/// A symmetric matrix as directions * diagonal(eigenvalues) * directions^T.
struct SymmetricEigen {
  Vector6d eigenvalues;  ///< ascending
  Matrix6d directions;   ///< orthonormal columns
};

/// Only the lower triangle is read.
[[nodiscard]] SymmetricEigen symmetric_eigen(const Matrix6d& matrix);

}  // namespace geoflow::slam
