#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "geoflow/hal/image.hpp"

namespace geoflow::slam {

/// The gray image of a colour frame: shares the frame's memory when it is gray already, so keep the
/// frame as long.
[[nodiscard]] cv::Mat gray_image(const FrameRef& color);

/// A gray image with the pyramid that Lucas-Kanade reads: levels padded by the window, each with
/// its derivatives, so that these are computed once though a frame is both end and start of tracks.
/// Read-only after construction.
class ImagePyramid {
 public:
  ImagePyramid() = default;
  /// Copies and pads: keeps no reference to `gray` (CV_8UC1). Levels 0 to `levels`, halving each
  /// time.
  ImagePyramid(const cv::Mat& gray, int window_px, int levels);

  [[nodiscard]] bool empty() const noexcept { return levels_.empty(); }
  [[nodiscard]] const std::vector<cv::Mat>& levels() const noexcept { return levels_; }
  /// Level 0: the image itself.
  [[nodiscard]] const cv::Mat& image() const noexcept { return levels_.front(); }

 private:
  std::vector<cv::Mat> levels_;
};

}  // namespace geoflow::slam
