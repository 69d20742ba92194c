#include "vision/place_view.hpp"

#include <cstddef>
#include <cstring>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "geoflow/hal/image.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/pixel_depth.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {
namespace {

/// The descriptors of a view as a matrix with one row each.
cv::Mat1b descriptor_rows(const PlaceView& view) {
  cv::Mat1b rows(static_cast<int>(view.features.size()), static_cast<int>(sizeof(Descriptor)));
  for (std::size_t i = 0; i < view.features.size(); ++i) {
    std::memcpy(rows.ptr(static_cast<int>(i)), view.features[i].descriptor.data(),
                sizeof(Descriptor));
  }
  return rows;
}

}  // namespace

std::shared_ptr<const PlaceView> describe_place(const cv::Mat& gray, const FrameRef& depth,
                                                const DepthCloud* cloud, const CameraModel& camera,
                                                OrbExtractor& orb) {
  auto view = std::make_shared<PlaceView>();
  view->features = orb.extract(gray);
  view->p_cam.reserve(view->features.size());
  for (const OrbFeature& feature : view->features) {
    const double z = cloud == nullptr ? 0 : depth_at(*cloud, depth, feature.pixel);
    view->p_cam.push_back(camera.unproject(camera.undistort(feature.pixel), z));
  }
  return view;
}

std::vector<PlaceMatch> match_places(const PlaceView& a, const PlaceView& b) {
  std::vector<PlaceMatch> matches;
  if (a.features.size() < 2 || b.features.size() < 2) {
    return matches;
  }
  const cv::BFMatcher matcher{cv::NORM_HAMMING};
  const cv::Mat1b rows_a = descriptor_rows(a);
  const cv::Mat1b rows_b = descriptor_rows(b);
  std::vector<std::vector<cv::DMatch>> forward;
  std::vector<std::vector<cv::DMatch>> backward;
  matcher.knnMatch(rows_a, rows_b, forward, 2);
  matcher.knnMatch(rows_b, rows_a, backward, 1);
  for (const auto& two : forward) {
    const auto j = static_cast<std::size_t>(two[0].trainIdx);
    if (backward[j][0].trainIdx == two[0].queryIdx &&
        looks_alike(static_cast<double>(two[0].distance), static_cast<double>(two[1].distance))) {
      matches.push_back({static_cast<std::size_t>(two[0].queryIdx), j});
    }
  }
  return matches;
}

}  // namespace geoflow::slam
