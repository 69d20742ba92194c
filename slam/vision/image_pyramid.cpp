#include "vision/image_pyramid.hpp"

#include <cstddef>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "geoflow/hal/image.hpp"

namespace geoflow::slam {

cv::Mat gray_image(const FrameRef& color) {
  const ImageShape& shape = color.shape();
  const auto wrap = [&](int type) {
    // OpenCV has no read-only matrix; nothing below writes to it.
    void* pixels = const_cast<std::byte*>(
        color.bytes().data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    return cv::Mat{shape.height, shape.width, type, pixels};
  };
  cv::Mat gray;
  switch (shape.format) {
    case PixelFormat::kGray8:
      return wrap(CV_8UC1);
    case PixelFormat::kRgb8:
      cv::cvtColor(wrap(CV_8UC3), gray, cv::COLOR_RGB2GRAY);
      break;
    case PixelFormat::kBgr8:
      cv::cvtColor(wrap(CV_8UC3), gray, cv::COLOR_BGR2GRAY);
      break;
    case PixelFormat::kYuyv:
      cv::extractChannel(wrap(CV_8UC2), gray, 0);
      break;
    case PixelFormat::kDepth16:
      wrap(CV_16UC1).convertTo(gray, CV_8U, 1.0 / 256);
      break;
  }
  return gray;
}

ImagePyramid::ImagePyramid(const cv::Mat& gray, int window_px, int levels) {
  constexpr bool kWithDerivatives = true;
  constexpr bool kReuseInput = false;
  cv::buildOpticalFlowPyramid(gray, levels_, cv::Size{window_px, window_px}, levels,
                              kWithDerivatives, cv::BORDER_REFLECT_101, cv::BORDER_CONSTANT,
                              kReuseInput);
}

}  // namespace geoflow::slam
