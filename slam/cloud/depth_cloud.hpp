#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "cloud/cell_grid.hpp"

namespace geoflow::slam {

// NOLINTBEGIN(readability-magic-numbers): each number is the value of a member that names it
/// How a depth image becomes surfels.
struct DepthCloudConfig {
  int cell_px = 8;            ///< side of a cell [px]
  double min_depth_m = 0.25;  ///< nearer pixels are not used
  double max_depth_m = 8.0;   ///< farther pixels are not used
  /// Standard deviation of one pixel's inverse depth [1/m], the same at every depth for a
  /// triangulating sensor: sigma(z) = this * z^2. Kinect v1: 1.425e-3 (Khoshelham & Elberink,
  /// "Accuracy and resolution of Kinect depth data", 2012, eq. 11); D435: about 2e-3 to 4e-3
  /// (subpixel 0.05 to 0.08 px of f = 384 px and a baseline of 50 mm; Intel, "Tuning D4xx depth
  /// cameras", 2019). Noise that a cell's own pixels show to be larger replaces it.
  double inverse_depth_sigma = 1.5e-3;
  /// Neighbouring pixels share the matching window, so their noise is correlated: this many count
  /// as one.
  double correlated_pixels = 16.0;
  double min_fill = 0.6;  ///< least part of a cell's pixels with depth
  /// A cell whose pixels miss their plane by more than this many inverse_depth_sigma (rms) is an
  /// edge, not a surface.
  double max_plane_rms = 3.0;
  double max_incidence_deg = 78.0;  ///< a steeper view of the surface is rejected
};
// NOLINTEND(readability-magic-numbers)

/// One small piece of surface in the camera frame [m]. Its covariance is plane-shaped, as in
/// generalised ICP: normal_variance along the normal, tangent_variance() along the other two
/// directions.
struct Surfel {
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  float normal_variance = 0;                         ///< [m^2]; 0: no surfel here
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< unit, towards the camera
  float tilt_variance = 0;  ///< of the normal's direction, about each tangent [rad^2]

  [[nodiscard]] bool valid() const noexcept { return normal_variance > 0.0F; }
};

/// A depth image as an organised grid of surfels: at most one a cell of the CellGrid. One pass over
/// the image; the memory is reused from frame to frame. Thread-compatible; const access from
/// several threads is fine.
class DepthCloud {
 public:
  /// `depth_unit_m`: metres per count of a pixel. The grid's cell size must be config.cell_px.
  DepthCloud(std::shared_ptr<const CellGrid> grid, double depth_unit_m,
             const DepthCloudConfig& config);

  /// Replaces the content by that of a kDepth16 image of the camera's size; anything else is
  /// kInvalidArgument and leaves the cloud empty. An image without usable depth gives an empty
  /// cloud.
  [[nodiscard]] Result<void> build(const FrameRef& depth);

  [[nodiscard]] const CellGrid& grid() const noexcept { return *grid_; }
  [[nodiscard]] const DepthCloudConfig& config() const noexcept { return config_; }
  /// One entry a cell, row by row; see Surfel::valid().
  [[nodiscard]] std::span<const Surfel> surfels() const noexcept { return surfels_; }
  /// The cells that hold a surfel, ascending.
  [[nodiscard]] std::span<const std::uint32_t> valid() const noexcept { return valid_; }
  [[nodiscard]] std::size_t size() const noexcept { return valid_.size(); }
  /// A surfel's variance within its surface at z = 1 m [m^2], growing with z^2: that of a point
  /// drawn from its cell.
  [[nodiscard]] float tangent_scale() const noexcept { return tangent_scale_; }

 private:
  struct Sums;
  void accumulate_row_of_cells(const FrameRef& depth, int cell_row);
  [[nodiscard]] Sums sums_of_cell(int column) const noexcept;
  [[nodiscard]] Surfel fit(const Sums& sums, const CellGrid::Ray& ray) const noexcept;
  void smooth_normals();
  [[nodiscard]] Eigen::Vector4f smoothed_normal(std::uint32_t cell) const noexcept;

  std::shared_ptr<const CellGrid> grid_;
  DepthCloudConfig config_;
  float unit_m_;
  float tangent_scale_;  ///< see tangent_scale()
  float min_cosine_;     ///< of the angle of incidence
  std::vector<Surfel> surfels_;
  std::vector<std::uint32_t> valid_;
  std::vector<Eigen::Vector4f> smoothed_;  ///< normal and tilt variance of each valid surfel
  std::vector<float> columns_;             ///< sums over a row of cells for each image column
};

}  // namespace geoflow::slam
