#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::d435i {

/// Where the two cameras see from.
struct RegistrationGeometry {
  CameraIntrinsics depth;  ///< without distortion: depth is rectified
  CameraIntrinsics color;
  SE3 T_cam_depth;
  double depth_unit_m = 1e-3;  // NOLINT(readability-magic-numbers): a millimetre
};

/// Depth registered to the colour camera: DepthAlignment::kExact.
///
/// The depth image is a surface through its pixels' centres, torn where neighbours differ by more
/// than kTornRatio of their depth; there each pixel keeps the half of its outline. The surface is
/// resampled on the colour image's pixels in two passes of one dimension (E. Catmull, A. R. Smith,
/// "3-D transformations of images in scanline order", SIGGRAPH 1980): along each depth row onto
/// colour columns, then along those onto colour rows. Inverse depth and row are carried along,
/// which a plane's perspective keeps linear, so that planes come out exactly. Where two surfaces
/// meet in a pixel, the nearer one is kept.
///
/// Thread-bound: it keeps its buffers.
class DepthRegistration {
 public:
  /// Neighbours whose depths differ by more than this share of the nearer one are not one surface.
  /// The floor 0.3 m below a D435i at 640x480 (f = 383 px) changes by z / (f h) a pixel: 4.4 % at
  /// 5 m.
  static constexpr float kTornRatio = 0.05F;

  /// kInvalidArgument for sizes or focal lengths that are not positive, and for distorted cameras
  /// of another model than kRadtan.
  [[nodiscard]] static Result<DepthRegistration> create(const RegistrationGeometry& geometry);

  /// `depth` (Z16: row by row, in depth units along the optical axis, 0: none; at any address) as
  /// the colour camera sees it, into `target`, likewise. Sizes are the geometry's: kInvalidData
  /// otherwise.
  [[nodiscard]] Result<void> run(std::span<const std::byte> depth, std::span<std::uint16_t> target);

 private:
  /// One row of points: column, row [px] and inverse depth, not positive where there is none.
  struct Row {
    std::vector<float> x;
    std::vector<float> y;
    std::vector<float> w;
    explicit Row(std::size_t size) : x(size), y(size), w(size) {}
  };

  explicit DepthRegistration(const RegistrationGeometry& geometry);
  void project(int v);
  void distort(Row& row) const;
  void resample_columns();
  void resample_rows();
  void write(std::span<std::uint16_t> target) const;

  RegistrationGeometry geometry_;
  Eigen::Matrix3f R_pixel_depth_;  ///< colour pixel of a depth ray, to scale
  Eigen::Vector3f p_pixel_depth_;  ///< and of the depth camera's centre, in depth units
  Eigen::Vector2f half_pitch_px_;  ///< half a depth pixel's outline in colour pixels
  std::vector<float> ray_x_;       ///< of each depth column
  std::vector<std::uint16_t> depth_row_;
  Row projected_;               ///< a depth row's points, in colour pixels
  Row above_;                   ///< the row before, one point for each colour column
  Row below_;                   ///< this row; x is not used in these
  std::vector<char> joined_;    ///< by colour column: above_ is one surface with its upper row
  std::vector<float> inverse_;  ///< the colour image's inverse depth
};

}  // namespace geoflow::drivers::d435i
