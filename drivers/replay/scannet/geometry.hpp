#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

/// Colour and depth of two pinhole cameras brought into one view: that of the colour camera, with
/// the depth camera's size and intrinsics, so that depth is moved as little as possible.
namespace geoflow::drivers::scannet {

/// Resamples BGR images between two distortion-free cameras at one place and in one direction. Each
/// pixel of the target is the mean of the source over its footprint, or linear between pixels where
/// that is smaller than one. Thread-safe once made.
class ColorResampler {
 public:
  ColorResampler(const CameraIntrinsics& source, const CameraIntrinsics& target);

  /// Three bytes a pixel, rows without gaps; beyond the source's edge, its edge goes on.
  /// Precondition: `image` is of the source's size.
  [[nodiscard]] std::vector<std::byte> operator()(std::span<const std::byte> image) const;

 private:
  /// The source pixels that one row or column of the target is a mean of.
  struct Footprint {
    std::size_t first = 0;
    std::vector<float> weights{};  ///< sum 1
  };
  [[nodiscard]] static std::vector<Footprint> footprints(double scale, double offset, int count,
                                                         int source_count);
  void add_rows(std::span<const std::byte> image, const Footprint& rows,
                std::vector<float>& sum) const;

  [[nodiscard]] static float mean_at(const Footprint& columns, const std::vector<float>& row,
                                     std::size_t channel);

  std::size_t source_width_;
  std::vector<Footprint> columns_;
  std::vector<Footprint> rows_;
};

/// Depth seen by the camera `target`, which stands at colour, from depth seen by `source`. Each
/// pixel covers the rectangle that its corners project to; the nearest wins. 0 where nothing is
/// seen. A copy where both cameras are the same. Pure.
[[nodiscard]] std::vector<std::uint16_t> register_depth(std::span<const std::uint16_t> depth,
                                                        const CameraIntrinsics& source,
                                                        const CameraIntrinsics& target,
                                                        const SE3& T_color_depth,
                                                        double counts_per_m);

}  // namespace geoflow::drivers::scannet
