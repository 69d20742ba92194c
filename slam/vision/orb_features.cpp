#include "vision/orb_features.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

namespace geoflow::slam {
namespace {

constexpr int kCandidates = 3000;  ///< strongest corners over all octaves, before the grid chooses
constexpr float kScaleFactor = 1.2F;
constexpr int kOctaves = 4;
constexpr int kPatchPx = 31;  ///< side of the patch that a descriptor compares pixels in

/// Hamming distances above this are as likely between different places as between views of one (ORB
/// paper, figure 7).
constexpr int kMaximumHamming = 64;
constexpr double kSecondBestRatio = 0.85;

/// Counts what has been taken of each grid cell.
class CellCount {
 public:
  CellCount(const cv::Size& image, int cell_px, int most)
      : cell_px_{cell_px},
        most_{most},
        count_(image.height / cell_px + 1, image.width / cell_px + 1, 0) {}

  /// Whether there is room in the cell of a pixel; takes it.
  bool take(double x, double y) {
    int& in_cell = count_(static_cast<int>(y) / cell_px_, static_cast<int>(x) / cell_px_);
    return in_cell < most_ && ++in_cell > 0;
  }

 private:
  int cell_px_;
  int most_;
  cv::Mat1i count_;
};

/// Keeps the strongest few of each grid cell, strongest first.
std::vector<cv::KeyPoint> spread(std::vector<cv::KeyPoint> candidates, const cv::Size& image,
                                 const FeatureConfig& config) {
  // By place where equally strong, so that the order is one whatever the detector's is.
  std::sort(candidates.begin(), candidates.end(), [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::tuple{-a.response, a.octave, a.pt.y, a.pt.x} <
           std::tuple{-b.response, b.octave, b.pt.y, b.pt.x};
  });
  CellCount cells{image, config.cell_px, config.described_per_cell};
  std::erase_if(candidates, [&](const cv::KeyPoint& key_point) {
    return !cells.take(static_cast<double>(key_point.pt.x), static_cast<double>(key_point.pt.y));
  });
  return candidates;
}

/// Marks the surroundings of taken pixels as not to be used (0); the rest is 255.
cv::Mat1b free_mask(const cv::Size& size, std::span<const Vector2d> taken, double radius_px) {
  constexpr unsigned char kFree = 255;
  cv::Mat1b mask{size, kFree};
  const int radius = static_cast<int>(std::lround(radius_px));
  const cv::Rect image{0, 0, size.width, size.height};
  for (const Vector2d& pixel : taken) {
    const cv::Point centre{static_cast<int>(std::lround(pixel.x())),
                           static_cast<int>(std::lround(pixel.y()))};
    const cv::Rect square{centre.x - radius, centre.y - radius, 2 * radius + 1, 2 * radius + 1};
    mask(square & image).setTo(0);
  }
  return mask;
}

}  // namespace

OrbExtractor::OrbExtractor(const FeatureConfig& config)
    : config_{config},
      orb_{cv::ORB::create(kCandidates, kScaleFactor, kOctaves, kPatchPx, 0, 2, cv::ORB::FAST_SCORE,
                           kPatchPx, config.fast_threshold)} {}

std::vector<OrbFeature> OrbExtractor::extract(const cv::Mat& gray) {
  std::vector<cv::KeyPoint> key_points;
  orb_->detect(gray, key_points);
  key_points = spread(std::move(key_points), gray.size(), config_);
  cv::Mat descriptors;
  orb_->compute(gray, key_points, descriptors);

  std::vector<OrbFeature> features(key_points.size());
  for (std::size_t i = 0; i < features.size(); ++i) {
    features[i].pixel =
        Vector2d{static_cast<double>(key_points[i].pt.x), static_cast<double>(key_points[i].pt.y)};
    std::memcpy(features[i].descriptor.data(), descriptors.ptr(static_cast<int>(i)),
                sizeof(Descriptor));
  }
  return features;
}

std::vector<OrbFeature> choose_new(std::span<const OrbFeature> features,
                                   std::span<const Vector2d> taken, const cv::Size& image,
                                   const FeatureConfig& config) {
  const cv::Mat1b mask = free_mask(image, taken, config.mask_radius_px);
  CellCount cells{image, config.cell_px, config.features_per_cell};
  std::vector<OrbFeature> chosen;
  for (const OrbFeature& feature : features) {
    const int x = static_cast<int>(std::lround(feature.pixel.x()));
    const int y = static_cast<int>(std::lround(feature.pixel.y()));
    if (mask(y, x) != 0 && cells.take(feature.pixel.x(), feature.pixel.y())) {
      chosen.push_back(feature);
    }
  }
  return chosen;
}

bool looks_alike(double distance, double second_distance) noexcept {
  return distance <= kMaximumHamming && distance <= kSecondBestRatio * second_distance;
}

std::vector<int> match_by_projection(std::span<const ExpectedFeature> expected,
                                     std::span<const OrbFeature> features, double radius_px) {
  constexpr int kNone = 1 << 16;
  std::vector<int> match(expected.size(), -1);
  std::vector<int> taken_by(features.size(), -1);
  std::vector<int> taken_distance(features.size(), kNone);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    int best = -1;
    int best_distance = kNone;
    int second_distance = kNone;
    for (std::size_t j = 0; j < features.size(); ++j) {
      if ((features[j].pixel - expected[i].pixel).squaredNorm() > radius_px * radius_px) {
        continue;
      }
      const int distance = hamming_distance(features[j].descriptor, expected[i].descriptor);
      if (distance < best_distance) {
        second_distance = best_distance;
        best_distance = distance;
        best = static_cast<int>(j);
      } else {
        second_distance = std::min(second_distance, distance);
      }
    }
    if (best < 0 || !looks_alike(best_distance, second_distance)) {
      continue;
    }
    const auto j = static_cast<std::size_t>(best);
    if (best_distance < taken_distance[j]) {
      if (taken_by[j] >= 0) {
        match[static_cast<std::size_t>(taken_by[j])] = -1;
      }
      taken_by[j] = static_cast<int>(i);
      taken_distance[j] = best_distance;
      match[i] = best;
    }
  }
  return match;
}

}  // namespace geoflow::slam
