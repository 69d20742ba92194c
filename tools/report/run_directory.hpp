#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {

/// What `geoflow replay` left in a folder (docs/cli.md).
struct RunDirectory {
  std::filesystem::path path;
  nlohmann::json report{};  ///< an object with all that the report's tables need of it
  std::vector<PoseEstimate> estimates{};
  TrajectoryFile live_base{};
  TrajectoryFile live_camera{};
  TrajectoryFile final_base{};
  TrajectoryFile final_camera{};

  /// The recording that was replayed, as the command line named it.
  [[nodiscard]] std::filesystem::path recording() const;
  /// The camera in the base, from the first pose of both; it is the same for all.
  [[nodiscard]] SE3 T_base_cam() const;
};

/// Whether a folder looks like one that `geoflow replay` wrote.
[[nodiscard]] bool is_run_directory(const std::filesystem::path& path);

/// Reads all of it. Errors name the file, and its line, byte or key: what is missing, cannot be
/// read, or is not as replay writes it.
[[nodiscard]] Result<RunDirectory> read_run(const std::filesystem::path& path);

/// Reads a JSON file; errors name it and the byte where it is none.
[[nodiscard]] Result<nlohmann::json> read_json(const std::filesystem::path& file);

}  // namespace geoflow::tools
