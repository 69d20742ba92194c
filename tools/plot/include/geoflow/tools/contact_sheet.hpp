#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

/// Camera images side by side, to see at a glance what a recording shows.
namespace geoflow::tools {

/// One picture of a sheet.
struct SheetImage {
  FrameRef image;  ///< of any pixel format but kYuyv
  std::string caption;
};

// NOLINTBEGIN(readability-magic-numbers): each default is named by its member
struct SheetOptions {
  int columns = 4;
  int tile_width_px = 320;
  double depth_unit_m = 1e-3;  ///< of kDepth16
  double depth_range_m = 6;  ///< at which depth has the last colour; what was not measured is black
};
// NOLINTEND(readability-magic-numbers)

/// Draws the pictures row by row, each with its caption below, depth in colours. The ending of
/// `path` decides: .png or .svg. Thread-safe. Errors: as save_figure(), an empty or YUYV image, an
/// option that is not positive.
[[nodiscard]] Result<void> save_contact_sheet(const std::vector<SheetImage>& images,
                                              const SheetOptions& options,
                                              const std::filesystem::path& path);

}  // namespace geoflow::tools
