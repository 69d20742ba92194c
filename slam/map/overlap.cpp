#include "map/overlap.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"

namespace geoflow::slam {
namespace {

/// As many surfels of a cloud decide how much of it another one sees: the share is then known to
/// about 5 %.
constexpr std::size_t kSamples = 100;
constexpr float kDepthTolerance =
    0.05F;  ///< relative difference of depth within which two surfaces are one

/// Surfels spread over the cloud, for a quick comparison.
std::vector<Eigen::Vector3f> sample(const DepthCloud& cloud) {
  std::vector<Eigen::Vector3f> samples;
  const std::size_t step = std::max<std::size_t>(1, cloud.size() / kSamples);
  for (std::size_t i = step / 2; i < cloud.size(); i += step) {
    samples.push_back(cloud.surfels()[cloud.valid()[i]].point);
  }
  return samples;
}

DepthAgreement agreement(const std::vector<Eigen::Vector3f>& samples, const DepthCloud& target,
                         const SE3& T_target_source) {
  const Eigen::Matrix3f R = T_target_source.rotation_matrix().cast<float>();
  const Eigen::Vector3f t = T_target_source.translation().cast<float>();
  std::size_t seen = 0;
  std::size_t agreeing = 0;
  for (const Eigen::Vector3f& sample : samples) {
    const Eigen::Vector3f p = R * sample + t;
    const std::optional<Eigen::Vector2i> cell = target.grid().project(p);
    if (!cell) {
      continue;
    }
    const int index = cell->y() * target.grid().columns() + cell->x();
    const Surfel& surfel = target.surfels()[static_cast<std::size_t>(index)];
    if (surfel.valid()) {
      ++seen;
      agreeing += std::abs(surfel.point.z() - p.z()) < kDepthTolerance * p.z() ? 1U : 0U;
    }
  }
  const double all = std::max(1.0, static_cast<double>(samples.size()));
  return {.seen = static_cast<double>(seen) / all, .agreeing = static_cast<double>(agreeing) / all};
}

}  // namespace

DepthAgreement depth_agreement(const DepthCloud& source, const DepthCloud& target,
                               const SE3& T_target_source) {
  return agreement(sample(source), target, T_target_source);
}

std::vector<OverlappingKeyframe> overlapping_keyframes(const Map& map, const DepthCloud& cloud,
                                                       const SE3& T_odom_cam,
                                                       double least_overlap) {
  const std::vector<Eigen::Vector3f> samples = sample(cloud);
  std::vector<OverlappingKeyframe> found;
  for (const auto& [id, keyframe] : map.keyframes()) {
    if (!keyframe.cloud || keyframe.part != map.newest_part()) {
      continue;
    }
    const double share =
        agreement(samples, *keyframe.cloud, keyframe.T_odom_cam.inverse() * T_odom_cam).agreeing;
    if (share >= least_overlap) {
      found.push_back({id, share});
    }
  }
  std::ranges::sort(found, [](const auto& a, const auto& b) {
    return a.overlap > b.overlap || (a.overlap == b.overlap && a.id < b.id);
  });
  return found;
}

std::vector<KeyframeId> registration_targets(const std::vector<OverlappingKeyframe>& overlapping,
                                             std::size_t count) {
  std::vector<KeyframeId> targets;
  if (overlapping.empty() || count == 0) {
    return targets;
  }
  targets.push_back(overlapping.front().id);
  std::vector<KeyframeId> rest;
  for (auto it = overlapping.begin() + 1; it != overlapping.end(); ++it) {
    rest.push_back(it->id);
  }
  std::ranges::sort(rest);
  rest.resize(std::min(rest.size(), count - 1));
  targets.insert(targets.end(), rest.begin(), rest.end());
  return targets;
}

}  // namespace geoflow::slam
