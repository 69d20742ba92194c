#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools {

/// Normalised estimation error squared, e^T covariance^-1 e for each degree of freedom: 1 on
/// average where the covariance is true, more where it promises too much (Bar-Shalom, Li,
/// Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section 5.4).
struct Nees {
  std::size_t estimates = 0;
  double position = 0;     ///< mean over estimates, 3 degrees of freedom
  double orientation = 0;  ///< likewise
  double pose = 0;         ///< likewise, 6 degrees of freedom
  double within_95 = 0;    ///< part of the estimates whose error the 95 % ellipsoid contains
};

/// One estimate's error beside what its covariance says of it.
struct NormalisedError {
  HostTime t;  ///< on the reference's time line
  TrackingStatus status = TrackingStatus::kStarting;
  /// log(T_base_true): rotation [rad], then translation [m], in the estimated base's frame.
  Vector6d error = Vector6d::Zero();
  Vector6d sigma = Vector6d::Zero();  ///< standard deviations claimed of these, in the same order
  double nees_position = 0;           ///< as in Nees, of this one estimate
  double nees_orientation = 0;
  double nees_pose = 0;
};

/// 95 % of true estimates have a NEES of the pose below this: chi-squared of 6 degrees of freedom,
/// divided by 6.
inline constexpr double kNeesPose95 = 12.591587 / 6;

/// Compares estimates with the truth from the first pair on, where odom and the truth's frame are
/// made one: a covariance of T_odom_base speaks of what has been lost since the start. One for each
/// pair but the first, in ascending order of time. Pure. Errors as in associate(); a covariance
/// that is not positive definite, saying when.
[[nodiscard]] Result<std::vector<NormalisedError>> normalised_errors(
    const std::vector<PoseEstimate>& estimates, const Trajectory& reference,
    const AssociationOptions& options);

/// How honest a run's covariances were, by status. Rows of statuses that did not occur are zero.
struct Consistency {
  std::array<Nees, static_cast<std::size_t>(TrackingStatus::kLost) + 1> by_status{};
  [[nodiscard]] const Nees& of(TrackingStatus status) const {
    return by_status.at(static_cast<std::size_t>(status));
  }
};

/// The means of normalised errors, by status. Pure.
[[nodiscard]] Consistency consistency(const std::vector<NormalisedError>& errors);

/// The JSON object that docs/evaluate.md documents: status -> figures.
[[nodiscard]] nlohmann::json to_json(const Consistency& consistency);

}  // namespace geoflow::tools
