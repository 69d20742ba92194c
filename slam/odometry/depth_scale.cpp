#include "odometry/depth_scale.hpp"

#include <cstdint>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"

namespace geoflow::slam {

void DepthScale::follow(const Vector3d& p_odom_cam, const DepthCloud* cloud) {
  if (cloud != nullptr && cloud->size() > 0) {
    double inverse_depths = 0;
    for (const std::uint32_t cell : cloud->valid()) {
      inverse_depths += 1.0 / static_cast<double>(cloud->surfels()[cell].point.z());
    }
    depth_m_ = static_cast<double>(cloud->size()) / inverse_depths;
  }
  if (last_) {
    way_ += depth_m_ * (p_odom_cam - *last_);
  }
  last_ = p_odom_cam;
}

void DepthScale::move(const SE3& T_odom1_odom0) {
  if (last_) {
    last_ = T_odom1_odom0 * *last_;
    way_ = T_odom1_odom0.rotation() * way_;
  }
}

}  // namespace geoflow::slam
