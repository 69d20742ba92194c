#pragma once

#include <chrono>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {

/// An estimated and a true pose of the same instant, each in the frame of its own file.
struct PosePair {
  HostTime t;  ///< on the reference's time line: the estimate's time plus the offset
  SE3 estimate;
  SE3 reference;
  /// The rotations as their file has them: equal to those above, but for the rounding in a file of
  /// matrices, which evo leaves in and which shows in the sixth digit of relative errors.
  Matrix3d R_estimate = estimate.rotation_matrix();
  Matrix3d R_reference = reference.rotation_matrix();
};

/// In ascending order of time.
using PosePairs = std::vector<PosePair>;

struct AssociationOptions {
  /// Poses further apart in time than this are no pair.
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  Duration max_difference = std::chrono::milliseconds{10};
  /// Added to the estimate's times first. At most kMaxOffset either way.
  Duration offset{};
};

/// About three years: far beyond any difference of clocks that is not a difference of epochs.
inline constexpr Duration kMaxOffset = std::chrono::seconds{100'000'000};

/// Pairs poses by time: each pose of the shorter trajectory with the nearest one of the longer, as
/// evo does (github.com/MichaelGrupp/evo, evo/core/sync.py); where two choose the same one, only
/// the nearer of them is kept. Both in ascending order of time. Pure. Errors: an option out of
/// range; no pair, saying how far apart the time spans are.
[[nodiscard]] Result<PosePairs> associate(const Trajectory& estimate, const Trajectory& reference,
                                          const AssociationOptions& options);

/// Pairs two files: by time, or line by line where both have no times (KITTI). Errors also when
/// only one of them has times, or when they have none and differ in length.
[[nodiscard]] Result<PosePairs> associate(const TrajectoryFile& estimate,
                                          const TrajectoryFile& reference,
                                          const AssociationOptions& options);

}  // namespace geoflow::tools
