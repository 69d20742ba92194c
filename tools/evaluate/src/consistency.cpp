#include "geoflow/tools/evaluate/consistency.hpp"

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools {
namespace {

constexpr double kHalf = 3;  // degrees of freedom of position, and of orientation

/// e^T covariance^-1 e; none where the covariance is not positive definite.
template <typename Matrix, typename Vector>
std::optional<double> normalised(const Matrix& covariance, const Vector& error) {
  const Eigen::LLT<Matrix> factor{covariance};
  if (factor.info() != Eigen::Success) {
    return std::nullopt;
  }
  return error.dot(factor.solve(error));
}

/// False where the covariance is not positive definite.
bool normalise(const Matrix6d& covariance, NormalisedError& out) {
  const auto whole = normalised(covariance, out.error);
  const auto orientation =
      normalised(Matrix3d{covariance.topLeftCorner<3, 3>()}, Vector3d{out.error.head<3>()});
  const auto position =
      normalised(Matrix3d{covariance.bottomRightCorner<3, 3>()}, Vector3d{out.error.tail<3>()});
  if (!whole || !orientation || !position) {
    return false;
  }
  out.sigma = covariance.diagonal().cwiseSqrt();
  out.nees_position = *position / kHalf;
  out.nees_orientation = *orientation / kHalf;
  out.nees_pose = *whole / (2 * kHalf);
  return true;
}

void add(Nees& nees, const NormalisedError& one) {
  ++nees.estimates;
  nees.position += one.nees_position;
  nees.orientation += one.nees_orientation;
  nees.pose += one.nees_pose;
  nees.within_95 += one.nees_pose <= kNeesPose95 ? 1.0 : 0.0;
}

void average(Nees& nees) {
  if (nees.estimates > 0) {
    const auto count = static_cast<double>(nees.estimates);
    for (double* sum : {&nees.position, &nees.orientation, &nees.pose, &nees.within_95}) {
      *sum /= count;
    }
  }
}

}  // namespace

Result<std::vector<NormalisedError>> normalised_errors(const std::vector<PoseEstimate>& estimates,
                                                       const Trajectory& reference,
                                                       const AssociationOptions& options) {
  Trajectory trajectory;
  for (const PoseEstimate& estimate : estimates) {
    trajectory.push_back({estimate.t, estimate.T_odom_base});
  }
  const auto pairs = associate(trajectory, reference, options);
  if (!pairs) {
    return tl::unexpected{pairs.error()};
  }
  std::vector<NormalisedError> errors;
  const SE3 T_odom_ref = pairs->front().estimate * pairs->front().reference.inverse();
  auto estimate = estimates.begin();
  for (std::size_t i = 1; i < pairs->size(); ++i) {
    const PosePair& pair = (*pairs)[i];
    while (estimate->t + options.offset != pair.t) {
      ++estimate;
    }
    NormalisedError one{.t = pair.t, .status = estimate->status};
    one.error = (pair.estimate.inverse() * (T_odom_ref * pair.reference)).log();
    if (!normalise(estimate->covariance, one)) {
      return fail(ErrorCode::kInvalidData, "the covariance at {} ns is not positive definite",
                  estimate->t.time_since_epoch().count());
    }
    errors.push_back(one);
  }
  return errors;
}

Consistency consistency(const std::vector<NormalisedError>& errors) {
  Consistency result;
  for (const NormalisedError& one : errors) {
    add(result.by_status.at(static_cast<std::size_t>(one.status)), one);
  }
  for (Nees& nees : result.by_status) {
    average(nees);
  }
  return result;
}

nlohmann::json to_json(const Consistency& consistency) {
  nlohmann::json rows = nlohmann::json::object();
  for (std::size_t i = 0; i < consistency.by_status.size(); ++i) {
    const Nees& nees = consistency.by_status.at(i);
    if (nees.estimates > 0) {
      rows[to_string(static_cast<TrackingStatus>(i))] = {{"estimates", nees.estimates},
                                                         {"nees_position", nees.position},
                                                         {"nees_orientation", nees.orientation},
                                                         {"nees_pose", nees.pose},
                                                         {"within_95", nees.within_95}};
    }
  }
  return rows;
}

}  // namespace geoflow::tools
