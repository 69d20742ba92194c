#include "vision/corners.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <tuple>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "geoflow/slam/config.hpp"

#include "vision/cell_count.hpp"

namespace geoflow::slam {
namespace {

constexpr int kClearThreshold = 20;           ///< contrast of a corner that any light shows [gray]
constexpr int kPatchRadiusPx = kPatchPx / 2;  ///< no corner nearer than this to an octave's edge
constexpr int kFastRadiusPx = 3;              ///< of the circle that FAST compares

/// Half the width of the round patch in each row from its centre [px]; the same in each column.
std::array<int, kPatchRadiusPx + 1> half_widths() {
  std::array<int, kPatchRadiusPx + 1> widths{};
  constexpr double kRadiusPx = 0.5 * kPatchPx;
  for (int row = 0; row <= kPatchRadiusPx; ++row) {
    widths[static_cast<std::size_t>(row)] =
        static_cast<int>(std::sqrt(kRadiusPx * kRadiusPx - row * row));
  }
  return widths;
}

/// Direction from a pixel to the centroid of the intensities around it [deg], 0 to 360.
float orientation(const cv::Mat1b& image, const cv::Point& centre) {
  static const std::array<int, kPatchRadiusPx + 1> widths = half_widths();
  int moment_x = 0;
  int moment_y = 0;
  for (int dy = -kPatchRadiusPx; dy <= kPatchRadiusPx; ++dy) {
    const int half = widths[static_cast<std::size_t>(std::abs(dy))];
    const unsigned char* row = image.ptr(centre.y + dy) + centre.x;
    int sum = 0;
    for (int dx = -half; dx <= half; ++dx) {
      sum += row[dx];
      moment_x += dx * row[dx];
    }
    moment_y += dy * sum;
  }
  return cv::fastAtan2(static_cast<float>(moment_y), static_cast<float>(moment_x));
}

/// Corners of one region of an octave, in the octave's pixels.
std::vector<cv::KeyPoint> fast(const cv::Mat1b& octave, const cv::Rect& region, int threshold) {
  std::vector<cv::KeyPoint> found;
  cv::FAST(octave(region), found, threshold, true);
  for (cv::KeyPoint& corner : found) {
    corner.pt += cv::Point2f{region.tl()};
  }
  return found;
}

/// Where a corner's patch and FAST's circle around it lie in the octave.
cv::Rect searchable(const cv::Size& size) {
  constexpr int kMargin = kPatchRadiusPx + 1 - kFastRadiusPx;
  return cv::Rect{kMargin, kMargin, size.width - 2 * kMargin, size.height - 2 * kMargin} &
         cv::Rect{{0, 0}, size};
}

/// The faint corners of the cells that have room left.
std::vector<cv::KeyPoint> faint_corners(const cv::Mat1b& gray, const CellCount& cells,
                                        const FeatureConfig& config) {
  std::vector<cv::KeyPoint> found;
  const cv::Rect inside = searchable(gray.size());
  for (int y = 0; y < gray.rows; y += config.cell_px) {
    for (int x = 0; x < gray.cols; x += config.cell_px) {
      constexpr int kBorder = kFastRadiusPx + 1;  // and a pixel for the non-maximum suppression
      const cv::Rect cell = cv::Rect{x - kBorder, y - kBorder, config.cell_px + 2 * kBorder,
                                     config.cell_px + 2 * kBorder} &
                            inside;
      if (!cells.has_room(x, y) || cell.empty()) {
        continue;
      }
      const cv::Rect own{x, y, config.cell_px, config.cell_px};
      std::ranges::copy_if(fast(gray, cell, config.fast_threshold), std::back_inserter(found),
                           [&](const cv::KeyPoint& corner) {
                             return own.contains(corner.pt) && corner.response < kClearThreshold;
                           });
    }
  }
  return found;
}

/// Leaves the strongest that there is room for, strongest first.
void keep_strongest(std::vector<cv::KeyPoint>& corners, CellCount& cells) {
  // By place where equally strong, so that the order is one whatever the detector's is.
  std::ranges::sort(corners, [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::tuple{-a.response, a.octave, a.pt.y, a.pt.x} <
           std::tuple{-b.response, b.octave, b.pt.y, b.pt.x};
  });
  std::erase_if(corners, [&](const cv::KeyPoint& corner) {
    return !cells.take(static_cast<double>(corner.pt.x), static_cast<double>(corner.pt.y));
  });
}

}  // namespace

std::vector<cv::KeyPoint> detect_corners(const cv::Mat& gray, const FeatureConfig& config) {
  std::array<cv::Mat1b, kOctaves> octaves;
  octaves[0] = gray;
  std::vector<cv::KeyPoint> corners;
  CellCount cells{gray.size(), config.cell_px, config.described_per_cell};
  for (int octave = 0; octave < kOctaves; ++octave) {
    cv::Mat1b& image = octaves[static_cast<std::size_t>(octave)];
    const double scale = std::pow(kOctaveScale, octave);
    if (octave > 0) {
      const cv::Size size{static_cast<int>(std::lround(gray.cols / scale)),
                          static_cast<int>(std::lround(gray.rows / scale))};
      cv::resize(octaves[static_cast<std::size_t>(octave - 1)], image, size, 0, 0,
                 cv::INTER_LINEAR_EXACT);
    }
    const cv::Rect region = searchable(image.size());
    if (region.empty()) {
      break;
    }
    const int threshold = std::max(kClearThreshold, config.fast_threshold);
    for (cv::KeyPoint& corner : fast(image, region, threshold)) {
      corner.octave = octave;
      corner.size = static_cast<float>(kPatchPx * scale);
      corner.pt *= scale;
      corners.push_back(corner);
    }
  }
  keep_strongest(corners, cells);
  std::vector<cv::KeyPoint> faint = faint_corners(octaves[0], cells, config);
  keep_strongest(faint, cells);
  for (cv::KeyPoint& corner : faint) {
    corner.size = kPatchPx;
    corner.octave = 0;
    corners.push_back(corner);
  }
  for (cv::KeyPoint& corner : corners) {
    const double scale = std::pow(kOctaveScale, corner.octave);
    const cv::Mat1b& image = octaves[static_cast<std::size_t>(corner.octave)];
    corner.angle = orientation(image, cv::Point{corner.pt / scale});
  }
  return corners;
}

}  // namespace geoflow::slam
