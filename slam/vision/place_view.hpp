#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"

#include "cloud/depth_cloud.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {

/// By what a place is known again: many ORB features of one image, far more than are tracked, since
/// two views have only some in common.
struct PlaceView {
  /// All features, spread over the image, strongest first within a cell.
  std::vector<OrbFeature> features;
  /// Of each feature: its measured position in the camera frame [m]; z = 0: no depth there.
  std::vector<Vector3d> p_cam;
};

/// Describes an image (CV_8UC1) and its registered depth with the cloud made of it (null: none).
[[nodiscard]] std::shared_ptr<const PlaceView> describe_place(const cv::Mat& gray,
                                                              const FrameRef& depth,
                                                              const DepthCloud* cloud,
                                                              const CameraModel& camera,
                                                              OrbExtractor& orb);

/// A pair of features of two views that look alike.
struct PlaceMatch {
  std::size_t a;  ///< index into the first view's features
  std::size_t b;  ///< index into the second's
};

/// Features that are each other's nearest in descriptor, close, and clearly nearer than `b`'s
/// second nearest.
[[nodiscard]] std::vector<PlaceMatch> match_places(const PlaceView& a, const PlaceView& b);

}  // namespace geoflow::slam
