#pragma once

#include "geoflow/hal/geometry.hpp"

/// Where a measurement of a pose contradicts what is believed of it.
namespace geoflow::slam {

/// For a measurement with the normal equations H x = -b in a right perturbation x of the mean of a
/// belief with `covariance`: a projector N, so that N^T H N and N^T b say what they said, but for
/// the directions in which the measurement and the belief contradict each other, of which they say
/// nothing. Directions are the measurement's own in the belief's units (eigenvectors of L^T H L
/// with L L^T the covariance): there both are independent, and the squared innovation over its
/// variance has one degree of freedom each. Identity where nothing contradicts, or where the
/// covariance is no covariance. Pure, thread-safe.
[[nodiscard]] Matrix6d agreeing(const Matrix6d& H, const Vector6d& b, const Matrix6d& covariance);

}  // namespace geoflow::slam
