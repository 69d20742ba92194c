#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

namespace geoflow::slam {

/// 256 binary comparisons (Rublee et al., "ORB: an efficient alternative to SIFT or SURF", ICCV
/// 2011).
using Descriptor = std::array<std::uint64_t, 4>;

/// Number of differing bits, 0 to 256.
[[nodiscard]] inline int hamming_distance(const Descriptor& a, const Descriptor& b) noexcept {
  int distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    distance += std::popcount(a[i] ^ b[i]);
  }
  return distance;
}

/// A corner with its descriptor, at a raw pixel.
struct OrbFeature {
  Vector2d pixel;
  Descriptor descriptor{};
};

/// ORB features spread over the image by a grid: the strongest few of each cell, so that texture in
/// one corner does not take them all. Keeps buffers between calls: thread-bound.
class OrbExtractor {
 public:
  explicit OrbExtractor(const FeatureConfig& config);

  /// Features of a gray image (CV_8UC1), at most FeatureConfig::described_per_cell in a cell,
  /// strongest first.
  [[nodiscard]] std::vector<OrbFeature> extract(const cv::Mat& gray);

 private:
  FeatureConfig config_;
  cv::Ptr<cv::ORB> orb_;
};

/// Those of `features` that are worth tracking beside what is tracked already: at most
/// features_per_cell in a cell, none within mask_radius_px of the raw pixels in `taken` or of an
/// earlier one.
[[nodiscard]] std::vector<OrbFeature> choose_new(std::span<const OrbFeature> features,
                                                 std::span<const Vector2d> taken,
                                                 const cv::Size& image,
                                                 const FeatureConfig& config);

/// Whether a descriptor at this Hamming distance is the same place's, given that of the second
/// nearest one.
[[nodiscard]] bool looks_alike(double distance, double second_distance) noexcept;

/// A place where a described feature is expected.
struct ExpectedFeature {
  Vector2d pixel;  ///< raw
  Descriptor descriptor;
};

/// For each expected feature the index of the feature that is nearest in descriptor within
/// `radius_px`, clearly better than the second and not more than kMaximumHamming away; each feature
/// is given once, to the best. -1 where none.
[[nodiscard]] std::vector<int> match_by_projection(std::span<const ExpectedFeature> expected,
                                                   std::span<const OrbFeature> features,
                                                   double radius_px);

}  // namespace geoflow::slam
