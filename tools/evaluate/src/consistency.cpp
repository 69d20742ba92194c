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
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools {
namespace {

constexpr double kChiSquared95Of6 = 12.591587;
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

bool add(Nees& nees, const Matrix6d& covariance, const Vector6d& error) {
  const auto whole = normalised(covariance, error);
  const auto orientation =
      normalised(Matrix3d{covariance.topLeftCorner<3, 3>()}, Vector3d{error.head<3>()});
  const auto position =
      normalised(Matrix3d{covariance.bottomRightCorner<3, 3>()}, Vector3d{error.tail<3>()});
  if (!whole || !orientation || !position) {
    return false;
  }
  ++nees.estimates;
  nees.position += *position / kHalf;
  nees.orientation += *orientation / kHalf;
  nees.pose += *whole / (2 * kHalf);
  nees.within_95 += *whole <= kChiSquared95Of6 ? 1.0 : 0.0;
  return true;
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

Result<Consistency> consistency(const std::vector<PoseEstimate>& estimates,
                                const Trajectory& reference, const AssociationOptions& options) {
  Trajectory trajectory;
  for (const PoseEstimate& estimate : estimates) {
    trajectory.push_back({estimate.t, estimate.T_odom_base});
  }
  const auto pairs = associate(trajectory, reference, options);
  if (!pairs) {
    return tl::unexpected{pairs.error()};
  }
  Consistency result;
  const SE3 T_odom_ref = pairs->front().estimate * pairs->front().reference.inverse();
  auto estimate = estimates.begin();
  for (std::size_t i = 1; i < pairs->size(); ++i) {
    const PosePair& pair = (*pairs)[i];
    while (estimate->t + options.offset != pair.t) {
      ++estimate;
    }
    const Vector6d error = (pair.estimate.inverse() * (T_odom_ref * pair.reference)).log();
    Nees& nees = result.by_status.at(static_cast<std::size_t>(estimate->status));
    if (!add(nees, estimate->covariance, error)) {
      return fail(ErrorCode::kInvalidData, "the covariance at {} ns is not positive definite",
                  estimate->t.time_since_epoch().count());
    }
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
