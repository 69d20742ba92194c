#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/calibration.hpp"
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
  /// Least standard deviation of a cell's inverse depth that is believed [1/m].
  double least_sigma = 3e-4;
  double min_fill = 0.6;  ///< least part of a cell's pixels with depth
  /// A cell whose pixels miss their plane by more than this many times what most cells' do (rms) is
  /// an edge, not a surface.
  double max_plane_rms = 3.0;
  /// A normal is taken from as many rings of neighbouring cells as make it this certain [rad], if
  /// they continue the surface.
  double normal_sigma_rad = 0.015;
  double max_incidence_deg = 86.0;  ///< a steeper view of the surface is rejected
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
  /// Whether point and normal tell the depth here: also where the view is too steep for valid().
  [[nodiscard]] bool has_depth() const noexcept { return point.z() > 0.0F; }
};

/// A depth image as an organised grid of surfels: at most one a cell of the CellGrid. One pass over
/// the image; the memory is reused from frame to frame. Thread-compatible; const access from
/// several threads is fine.
class DepthCloud {
 public:
  /// What a depth image's numbers mean.
  struct Pixels {
    double unit_m;  ///< metres per count
    DepthAlignment alignment = DepthAlignment::kExact;
  };

  /// The grid's cell size must be config.cell_px.
  DepthCloud(std::shared_ptr<const CellGrid> grid, const Pixels& pixels,
             const DepthCloudConfig& config);

  /// A surfel and its cell.
  struct Stored {
    std::uint32_t cell = 0;
    Surfel surfel;
  };
  /// The cloud that has these surfels and this sigma(), as it was. Cells ascend and are of the
  /// grid.
  [[nodiscard]] static std::shared_ptr<const DepthCloud> restored(
      std::shared_ptr<const CellGrid> grid, const Pixels& pixels, float sigma,
      std::span<const Stored> surfels);

  /// Replaces the content by that of a kDepth16 image of the camera's size; anything else is
  /// kInvalidArgument and leaves the cloud empty. An image without usable depth gives an empty
  /// cloud.
  [[nodiscard]] Result<void> build(const FrameRef& depth);

  [[nodiscard]] const CellGrid& grid() const noexcept { return *grid_; }
  /// Standard deviation of a surfel's inverse depth [1/m], as the image shows it: the same at every
  /// depth for a triangulating sensor. Kinect v1: about 1e-3; D435: 2e-3 to 5e-3.
  [[nodiscard]] float sigma() const noexcept { return sigma_; }
  [[nodiscard]] const Pixels& pixels() const noexcept { return pixels_; }
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
  void drop_edges();
  void measure_noise();
  void smooth_normals();
  void drop_grazing();
  [[nodiscard]] Eigen::Vector4f smoothed_normal(std::uint32_t cell) const noexcept;

  std::shared_ptr<const CellGrid> grid_;
  DepthCloudConfig config_;
  Pixels pixels_;
  float tangent_scale_;  ///< see tangent_scale()
  float min_cosine_;     ///< of the angle of incidence
  float sigma_ = 0;      ///< see sigma()
  std::vector<Surfel> surfels_;
  std::vector<float> scratch_;
  std::vector<Eigen::Vector3f>
      rays_;  ///< of each surfel: x / z, y / z, 1 / z; 0 where there is none
  std::vector<std::uint32_t> valid_;
  std::vector<Eigen::Vector4f> smoothed_;  ///< normal and tilt variance of each valid surfel
  std::vector<float> columns_;             ///< sums over a row of cells for each image column
};

}  // namespace geoflow::slam
