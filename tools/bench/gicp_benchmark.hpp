#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

/// Frame-to-frame registration of depth images: this project's GICP beside PCL's.
namespace geoflow::tools {

// NOLINTBEGIN(readability-magic-numbers): each default is named by its member
struct GicpBenchmarkOptions {
  std::filesystem::path recording;  ///< with depth, and a reference trajectory
  std::optional<std::filesystem::path>
      reference{};  ///< TUM file of camera poses; none: groundtruth.txt in `recording`
  std::vector<int> steps = {1, 3, 5};  ///< frames between the two of a pair
  int pairs = 100;                     ///< consecutive pairs a step, from the first frame on
  double voxel_m = 0.02;               ///< of PCL's voxel grid
  double max_distance_m = 0.1;         ///< PCL's maximum correspondence distance
  int neighbours = 20;                 ///< PCL's neighbours for a covariance
};
// NOLINTEND(readability-magic-numbers)

/// One engine over one step. Times are CPU time of the one thread that it runs on; both engines
/// take turns on each pair.
struct GicpBenchmarkRow {
  std::string engine;  ///< `geoflow` or `pcl`
  int step = 0;
  int pairs = 0;
  double points = 0;         ///< median number of surfels or points
  double preprocess_ms = 0;  ///< median, one frame
  double register_ms = 0;    ///< median
  double total_ms = 0;       ///< median of the sum
  double total_p95_ms = 0;
  double translation_median_m = 0;  ///< error against the reference's relative pose
  double translation_rms_m = 0;
  double rotation_median_rad = 0;
  double rotation_rms_rad = 0;
  int not_converged = 0;
  double nees_mean =
      0;  ///< e^T information e; 6 when the covariance is right and the reference exact; 0 for pcl
};

/// Registers pairs (i, i + step) from identity, each with both engines in turn, on the calling
/// thread. Errors: the recording or reference cannot be read, or has too few frames with a pose.
[[nodiscard]] Result<std::vector<GicpBenchmarkRow>> run_gicp_benchmark(
    const GicpBenchmarkOptions& options);

}  // namespace geoflow::tools
