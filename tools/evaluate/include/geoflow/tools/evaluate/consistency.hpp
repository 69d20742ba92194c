#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
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

/// How honest a run's covariances were, by status. Rows of statuses that did not occur are zero.
struct Consistency {
  std::array<Nees, static_cast<std::size_t>(TrackingStatus::kLost) + 1> by_status{};
  [[nodiscard]] const Nees& of(TrackingStatus status) const {
    return by_status.at(static_cast<std::size_t>(status));
  }
};

/// Compares estimates with the truth from the first pair on, where odom and the truth's frame are
/// made one: a covariance of T_odom_base speaks of what has been lost since the start. Pure. Errors
/// as in associate(); a covariance that is not positive definite, saying when.
[[nodiscard]] Result<Consistency> consistency(const std::vector<PoseEstimate>& estimates,
                                              const Trajectory& reference,
                                              const AssociationOptions& options);

/// The JSON object that docs/evaluate.md documents: status -> figures.
[[nodiscard]] nlohmann::json to_json(const Consistency& consistency);

}  // namespace geoflow::tools
