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

/// Keeps the strongest few of each grid cell.
std::vector<cv::KeyPoint> spread(std::vector<cv::KeyPoint> candidates, const cv::Size& size,
                                 const FeatureConfig& config) {
  std::stable_sort(
      candidates.begin(), candidates.end(),
      [](const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response > b.response; });
  const int columns = size.width / config.cell_px + 1;
  const int rows = size.height / config.cell_px + 1;
  cv::Mat1i count(rows, columns, 0);
  std::vector<cv::KeyPoint> kept;
  for (const cv::KeyPoint& key_point : candidates) {
    int& in_cell = count(static_cast<int>(key_point.pt.y) / config.cell_px,
                         static_cast<int>(key_point.pt.x) / config.cell_px);
    if (in_cell < config.features_per_cell) {
      ++in_cell;
      kept.push_back(key_point);
    }
  }
  return kept;
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

std::vector<OrbFeature> OrbExtractor::extract(const cv::Mat& gray,
                                              std::span<const Vector2d> taken) {
  const cv::Mat1b mask = free_mask(gray.size(), taken, config_.mask_radius_px);
  std::vector<cv::KeyPoint> key_points;
  orb_->setFastThreshold(config_.fast_threshold);
  orb_->detect(gray, key_points, mask);
  key_points = spread(std::move(key_points), gray.size(), config_);
  const std::size_t cells =
      static_cast<std::size_t>((gray.cols / config_.cell_px) * (gray.rows / config_.cell_px));
  if (key_points.size() + taken.size() < cells) {
    orb_->setFastThreshold(config_.fast_threshold_minimum);
    std::vector<cv::KeyPoint> faint;
    orb_->detect(gray, faint, mask);
    key_points = spread(std::move(faint), gray.size(), config_);
  }
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
    if (best < 0 || best_distance > kMaximumHamming ||
        best_distance > kSecondBestRatio * second_distance) {
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
