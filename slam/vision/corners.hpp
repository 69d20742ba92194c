#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "geoflow/slam/config.hpp"

namespace geoflow::slam {

inline constexpr double kOctaveScale = 1.2;  ///< between the octaves that corners are looked for in
inline constexpr int kOctaves = 4;
inline constexpr int kPatchPx = 31;  ///< side of a corner's patch in its octave [px]

/// FAST corners (Rosten and Drummond, "Machine learning for high-speed corner detection", ECCV
/// 2006) of a gray image (CV_8UC1) and its octaves, spread by a grid: the strongest
/// FeatureConfig::described_per_cell of each cell, strongest first, with the orientation of their
/// intensity centroid (Rublee et al., ORB, ICCV 2011, section 3.2). Contrast is asked for first;
/// only cells that have too few such corners are searched for fainter ones, down to
/// FeatureConfig::fast_threshold. Pure; thread-safe.
[[nodiscard]] std::vector<cv::KeyPoint> detect_corners(const cv::Mat& gray,
                                                       const FeatureConfig& config);

}  // namespace geoflow::slam
