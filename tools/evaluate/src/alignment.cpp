#include "geoflow/tools/evaluate/alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kMinPairs = 3;
/// Positions that spread less than this fraction of their distance from zero stand still.
constexpr double kStationary = 1e-12;
/// A second singular value below this fraction of the first one is rounding: (1 um per m)^2.
constexpr double kCollinear = 1e-12;

/// The moments of both point sets that Umeyama's solution is made of.
struct Moments {
  Vector3d mean_estimate = Vector3d::Zero();
  Vector3d mean_reference = Vector3d::Zero();
  double variance_estimate = 0;            ///< eq. (36) [m^2]
  double variance_reference = 0;           ///< [m^2]
  double largest = 0;                      ///< the largest coordinate of any position [m]
  Matrix3d covariance = Matrix3d::Zero();  ///< eq. (38) [m^2]
};

Moments moments(const PosePairs& pairs) {
  Moments m;
  const auto count = static_cast<double>(pairs.size());
  for (const PosePair& pair : pairs) {
    m.mean_estimate += pair.estimate.translation() / count;
    m.mean_reference += pair.reference.translation() / count;
  }
  for (const PosePair& pair : pairs) {
    const Vector3d x = pair.estimate.translation() - m.mean_estimate;
    const Vector3d y = pair.reference.translation() - m.mean_reference;
    m.variance_estimate += x.squaredNorm() / count;
    m.variance_reference += y.squaredNorm() / count;
    m.covariance += y * x.transpose() / count;
    m.largest = std::max({m.largest, pair.estimate.translation().cwiseAbs().maxCoeff(),
                          pair.reference.translation().cwiseAbs().maxCoeff()});
  }
  return m;
}

Result<Similarity> umeyama(const PosePairs& pairs, bool with_scale) {
  if (pairs.size() < kMinPairs) {
    return fail(
        ErrorCode::kInvalidData,
        "only {} pairs of poses, but alignment needs at least 3: use the alignment origin or none",
        pairs.size());
  }
  const Moments m = moments(pairs);
  const double floor = kStationary * m.largest * kStationary * m.largest;
  if (!std::isfinite(m.variance_estimate) || !std::isfinite(m.variance_reference)) {
    return fail(ErrorCode::kInvalidData, "positions are too large to be aligned");
  }
  if (m.variance_estimate <= floor || m.variance_reference <= floor) {
    return fail(
        ErrorCode::kInvalidData,
        "the {} does not move, so no rotation can be found: use the alignment origin or none",
        m.variance_estimate <= floor ? "estimate" : "reference");
  }
  const Eigen::JacobiSVD<Matrix3d> svd{m.covariance, Eigen::ComputeFullU | Eigen::ComputeFullV};
  const Vector3d& d = svd.singularValues();
  // d(0) itself vanishes when the two motions are unrelated; the variances bound it from above.
  if (!(d(1) > kCollinear * std::sqrt(m.variance_estimate * m.variance_reference))) {
    return fail(
        ErrorCode::kInvalidData,
        "the positions lie on one line, so no rotation can be found: use the alignment origin "
        "or none");
  }
  Vector3d signs = Vector3d::Ones();  // the diagonal of S, eq. (43)
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) {
    signs(2) = -1;
  }
  const Matrix3d R_ref_est = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  const double scale = with_scale ? d.dot(signs) / m.variance_estimate : 1.0;
  return Similarity{
      .scale = scale,
      .T_ref_est = SE3{R_ref_est, m.mean_reference - scale * (R_ref_est * m.mean_estimate)}};
}

}  // namespace

const char* to_string(Alignment alignment) noexcept {
  switch (alignment) {
    case Alignment::kNone:
      return "none";
    case Alignment::kOrigin:
      return "origin";
    case Alignment::kSe3:
      return "se3";
    case Alignment::kSim3:
      return "sim3";
  }
  return "unknown";
}

Result<Similarity> align(const PosePairs& pairs, Alignment alignment) {
  if (pairs.empty()) {
    return fail(ErrorCode::kInvalidData, "no pairs of poses to align");
  }
  switch (alignment) {
    case Alignment::kNone:
      return Similarity{};
    case Alignment::kOrigin:
      return Similarity{.T_ref_est = pairs.front().reference * pairs.front().estimate.inverse()};
    case Alignment::kSe3:
      return umeyama(pairs, false);
    case Alignment::kSim3:
      return umeyama(pairs, true);
  }
  return fail(ErrorCode::kInvalidArgument, "unknown alignment");
}

PosePairs transformed(const Similarity& alignment, PosePairs pairs) {
  const Matrix3d R_ref_est = alignment.T_ref_est.rotation_matrix();
  for (PosePair& pair : pairs) {
    pair.estimate = alignment * pair.estimate;
    pair.R_estimate = R_ref_est * pair.R_estimate;
  }
  return pairs;
}

}  // namespace geoflow::tools
