#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"

/// Maps that outlive the process: docs/map-file.md.
namespace geoflow::slam {

/// A map as it was at one time, or as a file has it. Opaque and immutable; may be used in any
/// thread.
struct StoredMap;

/// Reads a map, except for the depth of its keyframes, which stays in the file until it is needed.
/// Errors name file, section and byte: kNotFound, kSystem, kInvalidData, or kUnsupported for a map
/// of another version.
[[nodiscard]] Result<std::shared_ptr<const StoredMap>> load_map(const std::filesystem::path& path);

/// Reads what load_map() leaves in the file: whether all of it is what was written.
[[nodiscard]] Result<void> check_depth(const StoredMap& map);

/// kInvalidArgument, with the difference, where a map was not made with this camera at this place
/// on the robot.
[[nodiscard]] Result<void> made_with(const StoredMap& map, const Calibration& calibration);

/// Writes a map so that `path` is the file that was there or the whole new one, whatever happens.
/// Errors: kUnavailable where somebody else is writing it, kSystem (as with a full disk), and what
/// its unread depth has.
[[nodiscard]] Result<void> save_map(const StoredMap& map, const std::filesystem::path& path);

/// What there is to say of a map.
struct MapSummary {
  std::string made_by;  ///< version of the program
  Calibration calibration;
  std::size_t keyframes = 0;
  std::size_t with_depth = 0;  ///< of those
  std::size_t points = 0;
  std::size_t edges = 0;
  std::size_t parts = 0;  ///< that nothing ties to one another
};
[[nodiscard]] MapSummary summary(const StoredMap& map);

/// T_map_base of the keyframes, in order of time as they were made.
[[nodiscard]] Trajectory keyframe_poses(const StoredMap& map);

/// The map's points [m].
[[nodiscard]] std::vector<Vector3d> sparse_points(const StoredMap& map);

/// A place that was known again: base_link's positions at the two keyframes that a loop ties [m].
struct MapLoop {
  Vector3d p_map_from = Vector3d::Zero();
  Vector3d p_map_to = Vector3d::Zero();
};
[[nodiscard]] std::vector<MapLoop> loops(const StoredMap& map);

/// A small piece of surface in the map.
struct MapSurfel {
  Vector3d p_map = Vector3d::Zero();       ///< [m]
  Vector3d normal_map = Vector3d::Zero();  ///< unit, towards the camera that saw it
  double sigma_m = 0;                      ///< along the normal
};

/// The keyframes' depth as planes, at most one surfel a cube of this size, the most certain one.
/// Errors as of check_depth().
[[nodiscard]] Result<std::vector<MapSurfel>> planes(const StoredMap& map, double cell_m);

}  // namespace geoflow::slam
