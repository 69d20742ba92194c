#pragma once

#include <filesystem>
#include <vector>

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"

/// A run's estimates with their covariances as a text file. All functions are pure apart from the
/// file they name, and thread-safe.
namespace geoflow::tools {

/// Writes one line of comma-separated values for each estimate, below a line that names them: `t
/// [ns]`, T_odom_base as position [m] and quaternion (w first), so that the file is a trajectory in
/// EuRoC's form too; status, source, quality, reset counter, map id; and the 21 values of the
/// covariance's upper triangle, row by row in the conventions of geometry.hpp. Replaces an existing
/// file.
[[nodiscard]] Result<void> write_estimates(const std::filesystem::path& path,
                                           const std::vector<PoseEstimate>& estimates);

/// Reads all that such a file holds of each estimate, in ascending order of time. Errors name file
/// and line: a missing or unreadable file, another number of columns, text that is no finite
/// number, status or source, a quaternion whose norm is not 1, times that do not ascend.
[[nodiscard]] Result<std::vector<PoseEstimate>> read_estimates(const std::filesystem::path& path);

}  // namespace geoflow::tools
