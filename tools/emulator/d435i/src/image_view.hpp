#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/hal/calibration.hpp"

namespace geoflow::emulator {

/// The pinhole camera of a D435i's image of `width` x `height`, cut from `source` about its middle
/// and scaled, aspect kept. That is how librealsense reads the colour table, so all sizes are one
/// camera; 848 x 100 and 256 x 144 are rows of 848 x 480 and the middle of 1920 x 1080, as the
/// depth table has them. The view has no distortion.
[[nodiscard]] CameraIntrinsics view_of(const CameraIntrinsics& source, int width, int height);

/// Which pixel of a source image each pixel of a view shows: the nearest to where its ray meets the
/// source.
class PixelMap {
 public:
  static constexpr std::int32_t kOutside = -1;

  PixelMap() = default;
  PixelMap(const CameraIntrinsics& source, const CameraIntrinsics& view);

  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int height() const noexcept { return height_; }
  [[nodiscard]] std::size_t size() const noexcept { return source_.size(); }
  /// Whether the view is the source image itself.
  [[nodiscard]] bool identity() const noexcept { return identity_; }
  /// Index of the source pixel, row by row, or kOutside.
  [[nodiscard]] std::int32_t operator[](std::size_t pixel) const noexcept { return source_[pixel]; }

 private:
  int width_ = 0;
  int height_ = 0;
  bool identity_ = false;
  std::vector<std::int32_t> source_;
};

}  // namespace geoflow::emulator
