#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "vision/camera_model.hpp"

/// A rolling shutter. A colour camera reads its rows one after the other, so that a feature is seen
/// earlier or later than the middle of its image, by up to half the readout: at a trot's yaw of
/// 0.3 rad/s and 20 ms two pixels. Here features are put where the image's middle would have shown
/// them, and how long the readout takes is found out from how they miss: no calibration names it.
/// Model: constant velocity over the readout, as in Hedborg, Forssen, Felsberg and Ringaby,
/// "Rolling shutter bundle adjustment", CVPR 2012.
namespace geoflow::slam {

/// How the camera moved while an image was read out.
struct RowMotion {
  Vector6d twist = Vector6d::Zero();  ///< of the camera in itself [rad/s, m/s]
  double readout_s = 0;               ///< from the first row to the last; negative: upwards
};

/// What a static point's ideal pixel has to be moved by for each second of readout, to where the
/// middle of the image would have shown it [px/s]. `row`: raw, where it was seen; `depth_m`: its z,
/// 0 where that is not known, which leaves the rotation. Pure.
[[nodiscard]] Vector2d row_shift(const CameraModel& camera, const Vector6d& twist,
                                 const Vector2d& ideal, double row, double depth_m);

/// What is known of a camera's readout. Thread-compatible.
class ReadoutEstimate {
 public:
  /// A feature's part in it.
  struct Feature {
    Vector2d shift = Vector2d::Zero();     ///< row_shift() of it [px/s]
    Vector2d residual = Vector2d::Zero();  ///< expected pixel less the seen one, as it was moved
    Eigen::Matrix<double, 2, 6> by_pose =
        Eigen::Matrix<double, 2, 6>::Zero();  ///< of the expected pixel
  };

  /// Takes one image's features, whose standard deviation is `sigma_px` and which were moved by
  /// seconds(). What a change of the pose explains as well says nothing.
  void add(std::span<const Feature> features, double sigma_px);

  /// The readout [s]; 0 as long as nothing is known of it, as for a global shutter.
  [[nodiscard]] double seconds() const noexcept { return seconds_; }
  /// Its standard deviation [s].
  [[nodiscard]] double sigma() const noexcept;

 private:
  double information_ = 0;  ///< [1/s^2]
  double weighted_ = 0;     ///< information times readout [1/s]
  double seconds_ = 0;
};

}  // namespace geoflow::slam
