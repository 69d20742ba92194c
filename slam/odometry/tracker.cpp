#include "odometry/tracker.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "map/overlap.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/pnp.hpp"

namespace geoflow::slam {
namespace {

constexpr std::size_t kRelocationKeyframes =
    30;  ///< newest keyframes that a lost frame is compared with
/// Two views whose depth agrees in this share of the surfels are of one place.
constexpr double kFits = 0.7;
/// A place found by descriptors is believed when its depth agrees in this share: a wrong one agrees
/// in few surfels.
constexpr double kSamePlace = 0.3;
/// A frame is registered to keyframes that see at least this share of its depth.
constexpr double kTargetOverlap = 0.5;

/// Where nothing is known of the pose, many features make up for the few that two views have in
/// common.
FeatureConfig dense(FeatureConfig config) {
  constexpr int kTimes = 4;
  config.features_per_cell *= kTimes;
  return config;
}

/// Registration from a guess that may be far off, as after a gap: besides the guess, no motion at
/// all, and, unless one of these fits well, motions around that in every direction. The one that
/// fits most of the surfels is taken.
RegistrationResult register_from_afar(const DepthCloud& source, const DepthCloud& target,
                                      const SE3& T_target_source_guess, const GicpConfig& config) {
  constexpr double kStepM = 0.2;
  constexpr double kStepRad = 0.15;
  RegistrationResult best = register_clouds(source, target, T_target_source_guess, config);
  const auto attempt = [&](const SE3& guess) {
    if (best.overlap < kFits || !best.converged) {
      const RegistrationResult result = register_clouds(source, target, guess, config);
      if (result.converged && (!best.converged || result.overlap > best.overlap)) {
        best = result;
      }
    }
  };
  attempt(SE3{});
  for (int axis = 0; axis < 6; ++axis) {
    const double step = axis < 3 ? kStepRad : kStepM;
    attempt(SE3::exp(step * Vector6d::Unit(axis)));
    attempt(SE3::exp(-step * Vector6d::Unit(axis)));
  }
  return best;
}

}  // namespace

Tracker::Tracker(const Config& config, const GicpConfig& gicp, const Calibration& calibration,
                 std::shared_ptr<const CellGrid> grid, StageObserver* observer)
    : config_{config},
      gicp_{gicp},
      calibration_{calibration},
      camera_{calibration.camera},
      flow_{config.flow, camera_},
      optimiser_{config.pose, config.mapping, gicp, camera_},
      orb_{config.features},
      dense_orb_{dense(config.features)},
      grid_{std::move(grid)},
      observer_{observer} {}

void Tracker::begin_frame(const SyncedPacket& packet) {
  std::swap(previous_, current_);
  current_ = Frame{};
  current_.t = packet.t;
  {
    const StageScope scope{observer_, Stage::kPyramid};
    current_.pyramid =
        ImagePyramid{gray_image(packet.color), config_.flow.window_px, config_.flow.levels};
  }
  const StageScope scope{observer_, Stage::kCloud};
  if (packet.depth) {
    auto cloud = std::make_shared<DepthCloud>(grid_, calibration_.depth_unit_m, DepthCloudConfig{});
    if (cloud->build(packet.depth)) {
      current_.cloud = std::move(cloud);
      current_.depth = packet.depth;
    }
  }
}

Feature Tracker::feature_at(const Vector2d& raw) const {
  return {.raw = raw,
          .ideal = camera_.undistort(raw),
          .depth_m = depth_at(current_.depth, raw, calibration_.depth_unit_m)};
}

void Tracker::follow_by_flow(const Map& map, const SE3& T_odom_cam_predicted) {
  const SE3 T_cam_odom = T_odom_cam_predicted.inverse();
  std::vector<FlowSeed> seeds;
  for (const Feature& feature : previous_.features) {
    FlowSeed seed{.previous = feature.raw, .predicted = std::nullopt};
    const MapPoint* point = feature.point ? map.find_point(*feature.point) : nullptr;
    if (point != nullptr) {
      const Vector3d p_cam = T_cam_odom * point->p_odom;
      if (p_cam.z() > 0) {
        seed.predicted = camera_.distort(camera_.project(p_cam));
      }
    }
    seeds.push_back(seed);
  }
  const auto tracks = flow_.track(previous_.pyramid, current_.pyramid, seeds);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (tracks[i]) {
      Feature feature = feature_at(*tracks[i]);
      feature.point = previous_.features[i].point;
      feature.anchor = previous_.features[i].anchor;
      feature.descriptor = previous_.features[i].descriptor;
      current_.features.push_back(feature);
    }
  }
}

void Tracker::follow_by_descriptors(const Map& map, const SE3& T_odom_cam_predicted) {
  constexpr double kRadiusPx = 30;
  const SE3 T_cam_odom = T_odom_cam_predicted.inverse();
  std::vector<PointId> points;
  std::vector<ExpectedFeature> expected;
  for (const Feature& feature : previous_.features) {
    const MapPoint* point = feature.point ? map.find_point(*feature.point) : nullptr;
    const Vector3d p_cam = point == nullptr ? Vector3d::Zero() : T_cam_odom * point->p_odom;
    if (p_cam.z() > 0) {
      points.push_back(*feature.point);
      expected.push_back({camera_.distort(camera_.project(p_cam)), point->descriptor});
    }
  }
  const std::vector<OrbFeature> found = orb_.extract(current_.pyramid.image(), {});
  const std::vector<int> match = match_by_projection(expected, found, kRadiusPx);
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0) {
      Feature feature = feature_at(found[static_cast<std::size_t>(match[i])].pixel);
      feature.point = points[i];
      current_.features.push_back(feature);
    }
  }
}

bool Tracker::agrees_in_depth(const Map& map, KeyframeId keyframe, const SE3& T_odom_cam) const {
  if (!current_.cloud) {
    return true;
  }
  const auto overlapping = overlapping_keyframes(map, *current_.cloud, T_odom_cam, kSamePlace);
  return std::any_of(overlapping.begin(), overlapping.end(),
                     [&](const OverlappingKeyframe& k) { return k.id == keyframe; });
}

std::optional<SE3> Tracker::relocate(const Map& map) {
  const std::vector<OrbFeature> found = dense_orb_.extract(current_.pyramid.image(), {});
  const double anywhere = camera_.intrinsics().width + camera_.intrinsics().height;
  const Vector2d middle{camera_.intrinsics().cx, camera_.intrinsics().cy};
  std::optional<SE3> best;
  std::size_t most = 0;
  std::size_t tried = 0;
  for (auto keyframe = map.keyframes().rbegin();
       keyframe != map.keyframes().rend() && tried < kRelocationKeyframes; ++keyframe, ++tried) {
    std::vector<ExpectedFeature> expected;
    for (const PointId id : keyframe->second.points) {
      expected.push_back({middle, map.find_point(id)->descriptor});
    }
    const std::vector<int> match = match_by_projection(expected, found, anywhere);
    std::vector<Feature> features;
    std::vector<VisualMatch> matches;
    for (std::size_t i = 0; i < match.size(); ++i) {
      if (match[i] >= 0) {
        Feature feature = feature_at(found[static_cast<std::size_t>(match[i])].pixel);
        feature.point = keyframe->second.points[i];
        features.push_back(feature);
        matches.push_back({map.find_point(*feature.point)->p_odom, feature.ideal, feature.depth_m});
      }
    }
    const std::optional<PnpSolution> solution =
        solve_pnp(matches, camera_, config_.pose, kPnpOnDescriptors);
    if (solution && solution->inliers > most &&
        agrees_in_depth(map, keyframe->first, solution->T_odom_cam)) {
      most = solution->inliers;
      best = solution->T_odom_cam;
      current_.features = std::move(features);
    }
  }
  return best;
}

std::vector<VisualMatch> Tracker::matches(const Map& map,
                                          std::vector<std::size_t>& feature_of_match) const {
  std::vector<VisualMatch> found;
  for (std::size_t i = 0; i < current_.features.size(); ++i) {
    const Feature& feature = current_.features[i];
    const MapPoint* point = feature.point ? map.find_point(*feature.point) : nullptr;
    if (point != nullptr) {
      found.push_back({point->p_odom, feature.ideal, feature.depth_m});
      feature_of_match.push_back(i);
    }
  }
  return found;
}

Tracker::InitialPose Tracker::initial_pose(const SE3& predicted,
                                           std::span<const VisualMatch> matches) const {
  const StageScope scope{observer_, Stage::kPoseInitialisation};
  if (const std::optional<PnpSolution> pose =
          solve_pnp(matches, camera_, config_.pose, kPnpOnTracks)) {
    return {pose->T_odom_cam, PoseSource::kPnp, true};
  }
  if (config_.switches.gicp && current_.cloud && previous_.cloud) {
    const SE3& T_odom_target = previous_.T_odom_cam;
    const RegistrationResult found = register_from_afar(*current_.cloud, *previous_.cloud,
                                                        T_odom_target.inverse() * predicted, gicp_);
    if (found.converged) {
      return {T_odom_target * found.T_target_source, PoseSource::kGicp, found.overlap > kFits};
    }
  }
  return {predicted, PoseSource::kConstantVelocity, false};
}

void Tracker::keep_inliers(Map& map, const std::vector<std::size_t>& feature_of_match,
                           const PoseSolution& solution) {
  std::vector<bool> keep(current_.features.size(), true);
  for (std::size_t k = 0; k < feature_of_match.size(); ++k) {
    const std::size_t i = feature_of_match[k];
    MapPoint& point = *map.find_point(*current_.features[i].point);
    ++point.expected;
    point.found += solution.inlier[k] ? 1U : 0U;
    keep[i] = solution.inlier[k];
  }
  std::vector<Feature> kept;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (keep[i]) {
      kept.push_back(current_.features[i]);
    }
  }
  current_.features = std::move(kept);
}

TrackingResult Tracker::track(Map& map, const MotionModel& motion) {
  TrackingResult result;
  const PosePrior prior = motion.predict(current_.t);
  {
    const StageScope scope{observer_, Stage::kFlow};
    if (config_.switches.optical_flow) {
      follow_by_flow(map, prior.T_odom_cam);
    } else {
      follow_by_descriptors(map, prior.T_odom_cam);
    }
  }
  std::vector<std::size_t> feature_of_match;
  std::vector<VisualMatch> visual = matches(map, feature_of_match);
  InitialPose initial = initial_pose(prior.T_odom_cam, visual);
  if (!initial.sure) {
    if (const std::optional<SE3> pose = relocate(map)) {
      initial = {*pose, PoseSource::kPnp, true};
      feature_of_match.clear();
      visual = matches(map, feature_of_match);
    }
  }
  result.source = initial.source;
  result.sure = initial.sure;

  const StageScope scope{observer_, Stage::kPoseOptimisation};
  std::vector<KeyframeId> targets;
  if (current_.cloud) {
    const auto overlapping =
        overlapping_keyframes(map, *current_.cloud, initial.T_odom_cam, kTargetOverlap);
    result.overlap = overlapping.empty() ? 0 : overlapping.front().overlap;
    targets =
        registration_targets(overlapping, static_cast<std::size_t>(config_.pose.gicp_targets));
  }
  std::vector<DepthTarget> depth_targets;
  if (config_.switches.gicp) {
    for (const KeyframeId id : targets) {
      depth_targets.push_back({map.keyframe(id).cloud.get(), map.keyframe(id).T_odom_cam});
    }
  }
  result.solution = optimiser_.solve(
      {.matches = visual, .cloud = current_.cloud.get(), .targets = depth_targets, .prior = prior},
      initial.T_odom_cam);
  current_.T_odom_cam = result.solution.T_odom_cam;
  keep_inliers(map, feature_of_match, result.solution);
  const auto enough = static_cast<std::uint32_t>(config_.pose.minimum_visual_inliers);
  result.visual_fix = result.solution.visual_inliers >= enough;
  result.depth_share = static_cast<double>(result.solution.depth_inliers) /
                       std::max(1.0, static_cast<double>(result.solution.depth_surfels));
  return result;
}

}  // namespace geoflow::slam
