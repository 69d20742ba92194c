#include "vision/orb_features.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"

#include "vision/cell_count.hpp"
#include "vision/corners.hpp"

namespace geoflow::slam {
namespace {

/// Hamming distances above this are as likely between different places as between views of one (ORB
/// paper, figure 7).
constexpr int kMaximumHamming = 64;
constexpr double kSecondBestRatio = 0.85;

/// The pixels that are further than a radius from all taken ones.
class FreePixels {
 public:
  FreePixels(const cv::Size& size, double radius_px)
      : free_{size, kFree}, radius_px_{static_cast<int>(std::lround(radius_px))} {}

  [[nodiscard]] bool contains(const Vector2d& pixel) const { return free_(at(pixel)) == kFree; }
  void take(const Vector2d& pixel) {
    const cv::Point corner = at(pixel) - cv::Point{radius_px_, radius_px_};
    const int side = 2 * radius_px_ + 1;
    free_(cv::Rect{corner, cv::Size{side, side}} & cv::Rect{{0, 0}, free_.size()}).setTo(0);
  }

 private:
  static constexpr unsigned char kFree = 255;
  static cv::Point at(const Vector2d& pixel) {
    return {static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y()))};
  }

  cv::Mat1b free_;
  int radius_px_;
};

}  // namespace

OrbExtractor::OrbExtractor(const FeatureConfig& config)
    : config_{config},
      orb_{cv::ORB::create(0, static_cast<float>(kOctaveScale), kOctaves, 0, 0, 2,
                           cv::ORB::FAST_SCORE, kPatchPx)} {}

std::vector<OrbFeature> OrbExtractor::extract(const cv::Mat& gray) {
  std::vector<cv::KeyPoint> key_points = detect_corners(gray, config_);
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
  FreePixels free{image, config.mask_radius_px};
  for (const Vector2d& pixel : taken) {
    free.take(pixel);
  }
  CellCount cells{image, config.cell_px, config.features_per_cell};
  std::vector<OrbFeature> chosen;
  for (const OrbFeature& feature : features) {
    if (free.contains(feature.pixel) && cells.take(feature.pixel.x(), feature.pixel.y())) {
      chosen.push_back(feature);
      free.take(feature.pixel);
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
