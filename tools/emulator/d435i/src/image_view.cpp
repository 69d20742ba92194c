#include "src/image_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::emulator {
namespace {

/// A ray on the plane at depth 1, as the lens shows it. Models: OpenCV's pinhole and fisheye
/// cameras.
Vector2d distorted(const CameraIntrinsics& camera, const Vector2d& ray) {
  const auto& k = camera.distortion;
  const double r2 = ray.squaredNorm();
  if (camera.model == DistortionModel::kRadtan) {
    const double radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const double xy = 2.0 * ray.x() * ray.y();
    return {ray.x() * radial + k[2] * xy + k[3] * (r2 + 2.0 * ray.x() * ray.x()),
            ray.y() * radial + k[2] * (r2 + 2.0 * ray.y() * ray.y()) + k[3] * xy};
  }
  if (camera.model == DistortionModel::kEquidistant && r2 > 0.0) {
    const double r = std::sqrt(r2);
    const double theta = std::atan(r);
    const double t2 = theta * theta;
    return ray * (theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r);
  }
  return ray;
}

struct Size {
  int width = 0;
  int height = 0;
  friend bool operator==(const Size&, const Size&) = default;
};

}  // namespace

CameraIntrinsics view_of(const CameraIntrinsics& source, int width, int height) {
  constexpr Size kRows{.width = 848, .height = 100};
  constexpr int kRowsOf = 480;
  constexpr double kFirstRow = 190;
  constexpr Size kMiddle{.width = 256, .height = 144};
  constexpr Size kMiddleOf{.width = 1920, .height = 1080};
  const Size size{.width = width, .height = height};
  CameraIntrinsics view;
  if (size == kRows) {
    view = view_of(source, width, kRowsOf);
    view.cy -= kFirstRow;
  } else if (size == kMiddle) {
    view = view_of(source, kMiddleOf.width, kMiddleOf.height);
    view.cx -= 0.5 * (kMiddleOf.width - width);
    view.cy -= 0.5 * (kMiddleOf.height - height);
  } else {
    const double scale = std::max(static_cast<double>(width) / source.width,
                                  static_cast<double>(height) / source.height);
    view.fx = scale * source.fx;
    view.fy = scale * source.fy;
    view.cx = 0.5 * width + scale * (source.cx - 0.5 * source.width);
    view.cy = 0.5 * height + scale * (source.cy - 0.5 * source.height);
  }
  view.width = width;
  view.height = height;
  return view;
}

PixelMap::PixelMap(const CameraIntrinsics& source, const CameraIntrinsics& view)
    : width_{view.width},
      height_{view.height},
      identity_{view.width == source.width && view.height == source.height},
      source_(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height)) {
  std::size_t pixel = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x, ++pixel) {
      const Vector2d ray = distorted(source, {(x - view.cx) / view.fx, (y - view.cy) / view.fy});
      const double u = std::floor(source.fx * ray.x() + source.cx + 0.5);
      const double v = std::floor(source.fy * ray.y() + source.cy + 0.5);
      const bool inside = u >= 0 && v >= 0 && u < source.width && v < source.height;
      source_[pixel] =
          inside ? static_cast<std::int32_t>(v) * source.width + static_cast<std::int32_t>(u)
                 : kOutside;
      identity_ = identity_ && source_[pixel] == static_cast<std::int32_t>(pixel);
    }
  }
}

}  // namespace geoflow::emulator
