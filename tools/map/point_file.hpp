#pragma once

#include <filesystem>
#include <span>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

/// Point clouds as text that CloudCompare, MeshLab, Open3D and PCL read: PLY (Turk, "The PLY
/// polygon file format", 1994) or PCD (PCL, "The PCD file format", version 0.7), as the file's
/// extension says. Pure apart from the file. Errors: kInvalidArgument for another extension,
/// kSystem.
namespace geoflow::tools {

/// `x y z` [m].
[[nodiscard]] Result<void> write_points(const std::filesystem::path& path,
                                        std::span<const Vector3d> points);

/// `x y z nx ny nz sigma`: position [m], unit normal, standard deviation along it [m].
[[nodiscard]] Result<void> write_points(const std::filesystem::path& path,
                                        std::span<const slam::MapSurfel> surfels);

}  // namespace geoflow::tools
