#include "place/relocaliser.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "cloud/gicp.hpp"
#include "cloud/gicp_search.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/overlap.hpp"
#include "odometry/frame.hpp"
#include "odometry/pose_optimiser.hpp"
#include "place/place_index.hpp"
#include "vision/dual_stream_flow.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"
#include "vision/pnp.hpp"

namespace geoflow::slam {
namespace {

/// Newest keyframes whose features are compared; further ones, of all, that look most like the
/// frame, one for each stretch of so many; and those whose depth is searched, which takes longer.
constexpr std::size_t kNewestByFeatures = 6;
constexpr std::size_t kAlikeByFeatures = 12;
constexpr std::uint32_t kStretch = 1;
constexpr std::size_t kNewestByDepth = 3;
/// A pose found from pairs of descriptors is a hypothesis when so many of them agree with it.
constexpr PnpEffort kHypothesis{.least_inliers = 8, .least_inlier_share = 0.2, .iterations = 400};
/// With so many it is certain.
constexpr std::size_t kCertainInliers = 20;
constexpr double kCertainShare = 0.4;
/// Otherwise it is confirmed by what the descriptors know nothing of. Either so many map points can
/// be followed from the keyframe's image into the frame's and agree on one pose: where there is
/// nothing to follow, a patch rarely returns to where it came from, and never in agreement with
/// others.
constexpr PnpEffort kConfirmation{
    .least_inliers = 20, .least_inlier_share = 0.5, .iterations = 100};
/// Or, where blur or another point of view leave little to follow, the depth seen in both views, if
/// it is so much, lies on one surface in this share, and leaves no direction open.
constexpr double kDepthConfirmsSeen = 0.3;
constexpr double kDepthConfirms = 0.9;
/// A pose that depth found has the support of the features when as many pairs of descriptors as a
/// hypothesis needs lie within this of where it puts them [px].
constexpr double kSupportPx = 8;
/// Without an image to follow them from, points are looked for within this of where a hypothesis
/// puts them [px].
constexpr double kSearchedPx = 10;
/// Followed points further from where the confirmed pose puts them are wrong [px].
constexpr double kFollowedPx = 5;
/// With so many followed the search ends.
constexpr std::size_t kPlenty = 60;
/// Keyframes with fewer points cannot confirm anything.
constexpr std::size_t kTextured = 40;
/// With a smaller share on one surface the views contradict each other.
constexpr double kDepthAgrees = 0.6;
/// The same where depth is all there is.
constexpr double kDepthDecides = 0.85;
/// With less of the depth seen in both views it says nothing.
constexpr double kDepthSeen = 0.15;

}  // namespace

std::vector<VisualMatch> Relocaliser::pairs(const Frame& frame, const Keyframe& keyframe) const {
  std::vector<VisualMatch> matches;
  for (const PlaceMatch& match : match_places(*frame.place, *keyframe.place)) {
    const Vector3d& p_cam = keyframe.place->p_cam[match.b];
    if (p_cam.z() > 0) {
      matches.push_back({keyframe.T_odom_cam * p_cam,
                         camera_.undistort(frame.place->features[match.a].pixel),
                         frame.place->p_cam[match.a].z()});
    }
  }
  return matches;
}

std::optional<Relocaliser::Hypothesis> Relocaliser::by_features(const Frame& frame,
                                                                const Keyframe& keyframe) const {
  const std::vector<VisualMatch> matches = pairs(frame, keyframe);
  const auto solution = solve_pnp(matches, camera_, config_.pose, kHypothesis);
  if (!solution) {
    return std::nullopt;
  }
  Hypothesis hypothesis = refined(frame, keyframe, solution->T_odom_cam);
  const double share = static_cast<double>(solution->inliers) / static_cast<double>(matches.size());
  hypothesis.certain =
      hypothesis.certain || (solution->inliers >= kCertainInliers && share >= kCertainShare);
  return hypothesis;
}

Relocaliser::Hypothesis Relocaliser::refined(const Frame& frame, const Keyframe& keyframe,
                                             const SE3& T_odom_cam) const {
  // What few features leave uncertain; a registration that goes further has found something else.
  constexpr double kFarM = 0.2;
  constexpr double kFarRad = 0.15;
  if (!frame.cloud || !keyframe.cloud) {
    return {.T_odom_cam = T_odom_cam, .certain = false};
  }
  const SE3& T_odom_keyframe = keyframe.T_odom_cam;
  const SE3 T_keyframe_cam = T_odom_keyframe.inverse() * T_odom_cam;
  const RegistrationResult found =
      register_clouds(*frame.cloud, *keyframe.cloud, T_keyframe_cam, gicp_);
  const SE3& T_keyframe_cam1 = found.T_target_source;
  const Vector6d moved = (T_keyframe_cam.inverse() * T_keyframe_cam1).log();
  // Whether the last steps were small enough does not matter here: the depth's agreement is looked
  // at.
  if (found.inliers == 0 || moved.head<3>().norm() > kFarRad || moved.tail<3>().norm() > kFarM) {
    return {.T_odom_cam = T_odom_cam, .certain = false};
  }
  return {.T_odom_cam = T_odom_cam * SE3::exp(moved),
          .certain = depth_confirms(frame, keyframe, found)};
}

bool Relocaliser::depth_confirms(const Frame& frame, const Keyframe& keyframe,
                                 const RegistrationResult& found) {
  const DepthAgreement depth =
      depth_agreement(*frame.cloud, *keyframe.cloud, found.T_target_source);
  return found.degenerate_directions == 0 && depth.seen > kDepthConfirmsSeen &&
         depth.agreeing > kDepthConfirms * depth.seen;
}

bool Relocaliser::features_support(const Frame& frame, const Keyframe& keyframe,
                                   const SE3& T_odom_cam) const {
  const SE3 T_cam_odom = T_odom_cam.inverse();
  const std::vector<VisualMatch> matches = pairs(frame, keyframe);
  const auto agree = std::count_if(matches.begin(), matches.end(), [&](const VisualMatch& match) {
    const Vector3d p_cam = T_cam_odom * match.p_odom;
    return p_cam.z() > 0 && (camera_.project(p_cam) - match.pixel).norm() < kSupportPx;
  });
  return static_cast<std::size_t>(agree) >= kHypothesis.least_inliers &&
         static_cast<double>(agree) >=
             kHypothesis.least_inlier_share * static_cast<double>(matches.size());
}

std::vector<FlowSeed> Relocaliser::seeds(const Map& map, KeyframeId id,
                                         const SE3& T_odom_cam) const {
  const SE3 T_cam_odom = T_odom_cam.inverse();
  std::vector<FlowSeed> seeds;
  for (const PointId point_id : map.keyframe(id).points) {
    const MapPoint& point = *map.find_point(point_id);
    const auto observation = std::ranges::find_if(
        point.observations, [&](const Observation& o) { return o.keyframe == id; });
    FlowSeed seed{.previous = camera_.distort(observation->pixel), .predicted = std::nullopt};
    const Vector3d p_cam = T_cam_odom * point.p_odom;
    if (p_cam.z() > 0) {
      seed.predicted = camera_.distort(camera_.project(p_cam));
    }
    seeds.push_back(seed);
  }
  return seeds;
}

std::vector<std::optional<Vector2d>> Relocaliser::find_points(const Map& map, const Frame& frame,
                                                              KeyframeId id,
                                                              const SE3& T_odom_cam) const {
  const Keyframe& keyframe = map.keyframe(id);
  const std::vector<FlowSeed> sought = seeds(map, id, T_odom_cam);
  if (keyframe.pyramid) {
    return flow_.track(*keyframe.pyramid, *frame.pyramid, sought);
  }
  std::vector<ExpectedFeature> expected;
  std::vector<std::size_t> point_of;
  for (std::size_t i = 0; i < sought.size(); ++i) {
    if (const std::optional<Vector2d>& predicted = sought[i].predicted) {
      expected.push_back({*predicted, map.find_point(keyframe.points[i])->descriptor});
      point_of.push_back(i);
    }
  }
  const std::vector<int> match = match_by_projection(expected, frame.place->features, kSearchedPx);
  std::vector<std::optional<Vector2d>> tracks(sought.size());
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0) {
      tracks[point_of[i]] = frame.place->features[static_cast<std::size_t>(match[i])].pixel;
    }
  }
  return tracks;
}

std::optional<Relocation> Relocaliser::confirmed(const Map& map, const Frame& frame, KeyframeId id,
                                                 const Hypothesis& hypothesis) const {
  const Keyframe& keyframe = map.keyframe(id);
  if (!keyframe.pyramid && !hypothesis.certain) {
    return std::nullopt;
  }
  const auto tracks = find_points(map, frame, id, hypothesis.T_odom_cam);
  std::vector<VisualMatch> matches;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (const std::optional<Vector2d>& track = tracks[i]) {
      matches.push_back({map.find_point(keyframe.points[i])->p_odom, camera_.undistort(*track), 0});
    }
  }
  Relocation found{.keyframe = id, .T_odom_cam = hypothesis.T_odom_cam, .tracks = {}};
  if (const auto solution = solve_pnp(matches, camera_, config_.pose, kConfirmation)) {
    found.T_odom_cam = solution->T_odom_cam;
  } else if (!hypothesis.certain || !keyframe.pyramid) {
    return std::nullopt;
  }
  if (!depth_agrees(frame, keyframe, found.T_odom_cam)) {
    return std::nullopt;
  }
  const SE3 T_cam_odom = found.T_odom_cam.inverse();
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (const std::optional<Vector2d>& track = tracks[i]) {
      const Vector3d p_cam = T_cam_odom * map.find_point(keyframe.points[i])->p_odom;
      const Vector2d off = camera_.project(p_cam) - camera_.undistort(*track);
      if (p_cam.z() > 0 && off.norm() < kFollowedPx) {
        found.tracks.push_back({keyframe.points[i], *track});
      }
    }
  }
  return found;
}

bool Relocaliser::depth_agrees(const Frame& frame, const Keyframe& keyframe,
                               const SE3& T_odom_cam) {
  if (!frame.cloud || !keyframe.cloud) {
    return true;
  }
  const DepthAgreement depth =
      depth_agreement(*frame.cloud, *keyframe.cloud, keyframe.T_odom_cam.inverse() * T_odom_cam);
  return depth.seen < kDepthSeen || depth.agreeing > kDepthAgrees * depth.seen;
}

std::optional<Relocation> Relocaliser::by_depth(const Map& map, const Frame& frame, KeyframeId id,
                                                const SE3& T_odom_cam_guess) const {
  const Keyframe& keyframe = map.keyframe(id);
  if (!frame.cloud || !keyframe.cloud) {
    return std::nullopt;
  }
  const SE3& T_odom_keyframe = keyframe.T_odom_cam;
  const RegistrationResult found = register_from_afar(
      *frame.cloud, *keyframe.cloud, T_odom_keyframe.inverse() * T_odom_cam_guess, gicp_);
  if (!found.converged) {
    return std::nullopt;
  }
  const SE3& T_keyframe_cam = found.T_target_source;
  const SE3 T_odom_cam = T_odom_keyframe * T_keyframe_cam;
  if (keyframe.points.size() >= kTextured) {
    const bool certain =
        depth_confirms(frame, keyframe, found) && features_support(frame, keyframe, T_odom_cam);
    return confirmed(map, frame, id, {.T_odom_cam = T_odom_cam, .certain = certain});
  }
  if (found.overlap < kDepthDecides || found.degenerate_directions > 0) {
    return std::nullopt;
  }
  return Relocation{.keyframe = id, .T_odom_cam = T_odom_cam, .tracks = {}};
}

std::vector<KeyframeId> Relocaliser::candidates(const Map& map, const Frame& frame) {
  std::vector<KeyframeId> chosen;
  for (auto it = map.keyframes().rbegin();
       it != map.keyframes().rend() && chosen.size() < kNewestByFeatures; ++it) {
    if (it->second.place && it->second.part == map.newest_part()) {
      chosen.push_back(it->first);
    }
  }
  auto ranking = map.places().query(*frame.place, map.places().size());
  std::erase_if(ranking, [&](const PlaceCandidate& candidate) {
    return map.keyframe(candidate.keyframe).part != map.newest_part();
  });
  for (const PlaceCandidate& candidate : peaks(ranking, kAlikeByFeatures, kStretch)) {
    if (std::ranges::find(chosen, candidate.keyframe) == chosen.end()) {
      chosen.push_back(candidate.keyframe);
    }
  }
  return chosen;
}

std::optional<Relocation> Relocaliser::find(const Map& map, const Frame& frame,
                                            const SE3& T_odom_cam_guess) const {
  std::optional<Relocation> best;
  const auto better = [&](const std::optional<Relocation>& found) {
    if (found && (!best || found->tracks.size() > best->tracks.size())) {
      best = found;
    }
  };
  for (const KeyframeId id : candidates(map, frame)) {
    const auto hypothesis = by_features(frame, map.keyframe(id));
    if (hypothesis) {
      better(confirmed(map, frame, id, *hypothesis));
    }
    if (best && best->tracks.size() >= kPlenty) {
      return best;
    }
  }
  std::size_t tried = 0;
  for (auto it = map.keyframes().rbegin();
       !best && it != map.keyframes().rend() && tried < kNewestByDepth; ++it, ++tried) {
    if (it->second.place && it->second.part == map.newest_part()) {
      better(by_depth(map, frame, it->first, T_odom_cam_guess));
    }
  }
  return best;
}

}  // namespace geoflow::slam
