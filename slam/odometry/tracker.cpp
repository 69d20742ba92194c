#include "odometry/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/stage.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "cloud/gicp_search.hpp"
#include "map/ids.hpp"
#include "map/local_map.hpp"
#include "map/map.hpp"
#include "map/overlap.hpp"
#include "odometry/frame.hpp"
#include "odometry/motion_model.hpp"
#include "odometry/pose_optimiser.hpp"
#include "optimisation/matrix6.hpp"
#include "place/relocaliser.hpp"
#include "vision/dual_stream_flow.hpp"
#include "vision/image_pyramid.hpp"
#include "vision/orb_features.hpp"
#include "vision/patch_alignment.hpp"
#include "vision/place_view.hpp"
#include "vision/pnp.hpp"
#include "vision/row_time.hpp"

namespace geoflow::slam {
namespace {

/// A frame is registered to keyframes that see at least this share of its depth.
constexpr double kTargetOverlap = 0.5;
/// Share of a frame's depth that has to agree with the map to be a fix by itself.
constexpr double kDepthCarriesOn = 0.5;

}  // namespace

std::uint8_t TrackingResult::quality() const {
  constexpr double kPlentyOfPoints = 100;
  constexpr double kFull = 100;
  const double visual = std::min(1.0, solution.visual_inliers / kPlentyOfPoints);
  const double depth = depth_fix ? overlap : 0;
  return static_cast<std::uint8_t>(std::lround(kFull * std::max(visual, depth)));
}

Tracker::Tracker(const Config& config, const GicpConfig& gicp, const Calibration& calibration,
                 std::shared_ptr<const CellGrid> grid, StageObserver* observer)
    : config_{config},
      gicp_{gicp},
      calibration_{calibration},
      camera_{calibration.camera},
      flow_{config.flow, camera_},
      refiner_{camera_},
      rows_{config.switches, calibration},
      optimiser_{config.pose, config.mapping, gicp, camera_},
      orb_{config.features},
      relocaliser_{config, gicp, camera_},
      grid_{std::move(grid)},
      observer_{observer} {}

Tracker::~Tracker() {
  cloud_building_.wait();
}

void Tracker::begin_frame(const SyncedPacket& packet) {
  finish_frame();
  std::swap(previous_, current_);
  current_ = Frame{};
  current_.t = packet.t;
  current_.depth = packet.depth;
  rows_.begin_frame(packet);
  cloud_building_.run([this] { build_cloud(); });
  const StageScope scope{observer_, Stage::kPyramid};
  current_.pyramid = std::make_shared<const ImagePyramid>(
      gray_image(packet.color), config_.flow.window_px, config_.flow.levels);
}

void Tracker::finish_frame() {
  cloud_building_.wait();
}

void Tracker::build_cloud() {
  const StageScope scope{observer_, Stage::kCloud};
  if (!current_.depth) {
    return;
  }
  auto cloud =
      std::make_shared<DepthCloud>(grid_,
                                   DepthCloud::Pixels{.unit_m = calibration_.depth_unit_m,
                                                      .alignment = calibration_.depth_alignment},
                                   DepthCloudConfig{});
  if (cloud->build(current_.depth)) {
    current_.cloud = std::move(cloud);
  } else {
    current_.depth = FrameRef{};
  }
}

void Tracker::follow_by_flow(const Map& map, const SE3& T_odom_cam_predicted) {
  const SE3 T_cam_odom = T_odom_cam_predicted.inverse();
  std::vector<FlowSeed> seeds;
  std::vector<double> depth_m;
  for (const Feature& feature : previous_.features) {
    FlowSeed seed{.previous = feature.raw, .predicted = std::nullopt};
    depth_m.push_back(0);
    const MapPoint* point = feature.point ? map.find_point(*feature.point) : nullptr;
    if (point != nullptr) {
      const Vector3d p_cam = T_cam_odom * point->p_odom;
      if (p_cam.z() > 0) {
        seed.predicted = camera_.distort(camera_.project(p_cam));
        depth_m.back() = p_cam.z();
      }
    }
    seeds.push_back(seed);
  }
  const auto tracks = flow_.track(
      *previous_.pyramid, *current_.pyramid, seeds, [&](std::size_t i, const Vector2d& pixel) {
        const std::optional<PointId>& id = previous_.features[i].point;
        const MapPoint* point = id ? map.find_point(*id) : nullptr;
        return point == nullptr
                   ? PatchSearch{}
                   : refiner_.refine(map, *point, T_odom_cam_predicted, *current_.pyramid, pixel);
      });
  finish_frame();
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (const std::optional<Vector2d>& track = tracks[i]) {
      Feature feature = current_.feature_at(*track, camera_, depth_m[i]);
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
    if (!feature.point) {
      continue;
    }
    const MapPoint* point = map.find_point(*feature.point);
    if (point == nullptr) {
      continue;
    }
    const Vector3d p_cam = T_cam_odom * point->p_odom;
    if (p_cam.z() > 0) {
      points.push_back(*feature.point);
      expected.push_back({camera_.distort(camera_.project(p_cam)), point->descriptor});
    }
  }
  finish_frame();
  describe();
  const std::vector<OrbFeature>& found = current_.place->features;
  const std::vector<int> match = match_by_projection(expected, found, kRadiusPx);
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0) {
      Feature feature =
          current_.feature_at(found[static_cast<std::size_t>(match[i])].pixel, camera_);
      feature.point = points[i];
      current_.features.push_back(feature);
    }
  }
}

void Tracker::describe() {
  if (!current_.place) {
    current_.place = describe_place(current_.pyramid->image(), current_.depth, current_.cloud.get(),
                                    camera_, orb_);
  }
}

std::optional<SE3> Tracker::relocate(const Map& map, const SE3& T_odom_cam_predicted) {
  describe();
  const auto found = relocaliser_.find(map, current_, T_odom_cam_predicted);
  if (!found) {
    return std::nullopt;
  }
  current_.features.clear();
  for (const Relocation::Track& track : found->tracks) {
    Feature feature = current_.feature_at(track.raw, camera_);
    feature.point = track.point;
    feature.descriptor = map.find_point(track.point)->descriptor;
    current_.features.push_back(feature);
  }
  return found->T_odom_cam;
}

std::vector<VisualMatch> Tracker::matches(const Map& map,
                                          std::vector<std::size_t>* feature_of_match) const {
  std::vector<VisualMatch> found;
  for (std::size_t i = 0; i < current_.features.size(); ++i) {
    const Feature& feature = current_.features[i];
    const MapPoint* point = feature.point ? map.find_point(*feature.point) : nullptr;
    if (point != nullptr) {
      found.push_back({point->p_odom, feature.ideal, feature.depth_m});
      if (feature_of_match != nullptr) {
        feature_of_match->push_back(i);
      }
    }
  }
  return found;
}

Tracker::InitialPose Tracker::initial_pose(const InitialPose& predicted,
                                           std::span<const VisualMatch> matches) const {
  const StageScope scope{observer_, Stage::kPoseInitialisation};
  // Tracks have been checked forward and backward: half of them should agree.
  const PnpEffort effort{
      .least_inliers = static_cast<std::size_t>(config_.pose.minimum_visual_inliers),
      .least_inlier_share = 0.5,
      .iterations = 100};
  if (const std::optional<PnpSolution> pose = solve_pnp(matches, camera_, config_.pose, effort)) {
    return {.T_odom_cam = pose->T_odom_cam, .source = PoseSource::kPnp, .sure = true};
  }
  if (config_.switches.gicp && current_.cloud && previous_.cloud) {
    const SE3& T_odom_target = previous_.T_odom_cam;
    const RegistrationResult found = register_from_afar(
        *current_.cloud, *previous_.cloud, T_odom_target.inverse() * predicted.T_odom_cam, gicp_);
    if (found.converged) {
      return {.T_odom_cam = T_odom_target * found.T_target_source,
              .source = PoseSource::kGicp,
              .sure = found.overlap > kGoodOverlap};
    }
  }
  return predicted;
}

void Tracker::keep_inliers(Map& map, const std::vector<std::size_t>& feature_of_match,
                           const PoseSolution& solution) {
  std::vector<bool> keep(current_.features.size(), true);
  for (std::size_t k = 0; k < feature_of_match.size(); ++k) {
    const std::size_t i = feature_of_match[k];
    if (const std::optional<PointId>& id = current_.features[i].point) {
      MapPoint& point = *map.find_point(*id);
      ++point.expected;
      point.found += solution.inlier[k] ? 1U : 0U;
    }
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

void Tracker::follow(const Map& map, const SE3& T_odom_cam_predicted) {
  const StageScope scope{observer_, Stage::kFlow};
  if (config_.switches.optical_flow) {
    follow_by_flow(map, T_odom_cam_predicted);
  } else {
    follow_by_descriptors(map, T_odom_cam_predicted);
  }
}

Tracker::InitialPose Tracker::first_guess(const Map& map, const InitialPose& predicted,
                                          bool blind) {
  follow(map, predicted.T_odom_cam);
  if (predicted.sure && previous_.anchored && !blind) {
    return predicted;
  }
  InitialPose initial = initial_pose(predicted, matches(map));
  const bool held = previous_.anchored && !blind;
  current_.anchored = held;
  if (!held || !initial.sure) {
    if (const std::optional<SE3> pose = relocate(map, predicted.T_odom_cam)) {
      current_.anchored = true;
      return {.T_odom_cam = *pose, .source = PoseSource::kPnp, .sure = true};
    }
  }
  if (!current_.anchored) {
    // What flow says of map points after the thread was lost may be anything.
    for (Feature& feature : current_.features) {
      feature.point.reset();
      feature.anchor.reset();
    }
    if (initial.source == PoseSource::kPnp) {
      initial = initial_pose(predicted, {});
    }
  }
  return initial;
}

std::vector<DepthTarget> Tracker::depth_targets(const Map& map, const SE3& T_odom_cam, bool blind,
                                                double& overlap) {
  if (!current_.cloud) {
    return {};
  }
  std::vector<DepthTarget> by_step;
  if (config_.switches.gicp && previous_.cloud && !blind) {
    by_step.push_back({previous_.cloud.get(), previous_.T_odom_cam});
  }
  if (!current_.anchored) {
    return by_step;
  }
  auto overlapping = overlapping_keyframes(map, *current_.cloud, T_odom_cam, kTargetOverlap);
  if (const KeyframeId newest = map.keyframes().rbegin()->first;
      !local_map_ || local_map_->newest() != newest) {
    local_map_.emplace(map, newest);
  }
  std::erase_if(overlapping, [&](const auto& k) { return !local_map_->contains(k.id); });
  overlap = overlapping.empty() ? 0 : overlapping.front().overlap;
  std::vector<DepthTarget> in_map;
  if (config_.switches.depth_to_map) {
    for (const KeyframeId id :
         registration_targets(overlapping, static_cast<std::size_t>(config_.pose.map_targets))) {
      in_map.push_back({map.keyframe(id).cloud.get(), map.keyframe(id).T_odom_cam});
    }
  }
  // What walks has hardly moved since the frame before, and would take the pose along; since a
  // keyframe it has.
  return in_map.empty() ? by_step : in_map;
}

TrackingResult Tracker::track(Map& map, const Prediction& predicted) {
  const PosePrior& prior = predicted.prior;
  TrackingResult result;
  const bool blind = is_blind(prior);
  if (!blind) {
    current_.rows = rows_.motion(previous_, current_.t, prior.T_odom_cam).value_or(RowMotion{});
  }
  // Legs and IMU come first (paper, IV-B): they know nothing of what moves in the image. But they
  // drift, so that a camera which sees again has to be looked for in the map.
  const bool reckoned = predicted.by == PoseSource::kLegs && fixed_;
  const InitialPose initial = first_guess(
      map, {.T_odom_cam = prior.T_odom_cam, .source = predicted.by, .sure = reckoned}, blind);
  result.source = initial.source;
  result.sure = initial.sure;
  result.anchored = current_.anchored;

  const StageScope scope{observer_, Stage::kPoseOptimisation};
  std::vector<std::size_t> feature_of_match;
  const std::vector<VisualMatch> visual = matches(map, &feature_of_match);
  const std::vector<DepthTarget> targets =
      depth_targets(map, initial.T_odom_cam, blind, result.overlap);
  result.solution = optimiser_.solve(
      {.matches = visual,
       .cloud = current_.cloud.get(),
       .targets = targets,
       .prior = prior,
       .reckoned = initial.source == PoseSource::kLegs ? predicted.since_keyframe : std::nullopt},
      initial.T_odom_cam);
  current_.T_odom_cam = result.solution.T_odom_cam;
  result.covariance = initial.sure ? result.solution.covariance : inverse(prior.information);
  if (initial.sure) {
    rows_.learn(current_, visual, feature_of_match, result.solution);
  }
  keep_inliers(map, feature_of_match, result.solution);
  const auto enough = static_cast<std::uint32_t>(config_.pose.minimum_visual_inliers);
  result.visual_fix = result.solution.visual_inliers >= enough;
  result.depth_share = static_cast<double>(result.solution.depth_inliers) /
                       std::max(1.0, static_cast<double>(result.solution.depth_surfels));
  result.depth_fix = result.depth_share > kDepthCarriesOn;
  fixed_ = result.visual_fix || result.depth_fix;
  return result;
}

}  // namespace geoflow::slam
