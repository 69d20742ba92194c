#include "place/loop_closer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "cloud/gicp.hpp"
#include "map/ids.hpp"
#include "map/local_map.hpp"
#include "map/map.hpp"
#include "map/overlap.hpp"
#include "odometry/pose_optimiser.hpp"
#include "optimisation/matrix6.hpp"
#include "place/loop_problem.hpp"
#include "place/place_index.hpp"
#include "vision/camera_model.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"
#include "vision/pnp.hpp"

namespace geoflow::slam {
namespace {

/// A keyframe must look like one of those at most so many before it.
constexpr std::uint32_t kBefore = 5;
/// Candidates compared, one for each stretch of so many keyframes.
constexpr std::size_t kCandidates = 3;
constexpr std::uint32_t kStretch = 3;
/// A candidate that looks less alike, in respect of the keyframe before, is none.
constexpr double kLeastAlike = 0.15;

/// A pose from pairs of descriptors.
constexpr PnpEffort kHypothesis{.least_inliers = 12, .least_inlier_share = 0.25, .iterations = 400};
/// With it, features are looked for so far from where it puts them [px].
constexpr double kGuidedPx = 10;
/// So many have to agree with the refined pose, and this share of those found near it; fewer where
/// odometry expects the view, more where the depth of one is gone; and beyond doubt with still
/// more.
constexpr std::uint32_t kInliers = 30;
constexpr std::uint32_t kFewInliers = 15;
constexpr std::uint32_t kInliersWithoutDepth = 60;
constexpr std::uint32_t kInliersBeyondDoubt = 120;
constexpr double kInlierShare = 0.5;
/// The depth seen in both views, as a share of each; and of that, what lies on one surface.
constexpr double kSeen = 0.3;
constexpr double kAgreeing = 0.85;
constexpr double kAgreeingWithFew = 0.9;
constexpr double kSeenBeyondDoubt = 0.5;
constexpr double kAgreeingBeyondDoubt = 0.95;
/// A pose less certain than this leaves a direction open (standard deviations).
constexpr double kOpenM = 0.05;
constexpr double kOpenRad = 0.03;

/// So many keyframes, among the last so many, have to find the same, to within this.
constexpr std::size_t kAgree = 3;
constexpr std::uint32_t kAmongLast = 8;
constexpr double kSameM = 0.1;
constexpr double kSameRad = 0.05;
/// What odometry can have drifted on the way: to begin with, and with the way.
constexpr double kDriftM = 0.3;
constexpr double kDriftMPerM = 0.05;
constexpr double kDriftRad = 0.15;
constexpr double kDriftRadPerM = 0.02;
/// What it usually does.
constexpr double kWayMPerM = 0.01;

/// What calibration and the sensor's own distortion leave of the pose between two views, however
/// many points and surfaces agree.
Matrix6d of_two_views() {
  constexpr double kSigmaM = 0.01;
  constexpr double kSigmaRad = 0.005;
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(kSigmaRad * kSigmaRad);
  covariance.diagonal().tail<3>().setConstant(kSigmaM * kSigmaM);
  return covariance;
}

/// Compares one new view with old ones.
class Verifier {
 public:
  explicit Verifier(const LoopProblem& problem)
      : problem_{problem},
        camera_{problem.camera},
        optimiser_{problem.config.pose, problem.config.mapping, problem.gicp, camera_} {}

  [[nodiscard]] std::optional<LoopHypothesis> compare(const LoopView& old) const {
    // The old camera's frame stands where PnP and optimiser have odom.
    const auto start = solve_pnp(pairs(old), camera_, problem_.config.pose, kHypothesis);
    if (!start && !old.T_this_new) {
      return std::nullopt;
    }
    const SE3 T_old_new = registered(old, start ? start->T_odom_cam : *old.T_this_new);
    const std::vector<VisualMatch> matches = guided(old, T_old_new);
    std::vector<DepthTarget> targets;
    const bool depth = problem_.newest.cloud && old.cloud;
    if (depth) {
      targets.push_back({old.cloud.get(), SE3{}});
    }
    const PosePrior prior{.T_odom_cam = T_old_new,  // frames: the old camera stands for odom
                          .information = Matrix6d::Identity()};  // a radian, a metre: nothing
    const PoseSolution solution = optimiser_.solve({.matches = matches,
                                                    .cloud = problem_.newest.cloud.get(),
                                                    .targets = targets,
                                                    .prior = prior},
                                                   T_old_new);
    const Vector6d variance = solution.covariance.diagonal();
    if (variance.head<3>().maxCoeff() > kOpenRad * kOpenRad ||
        variance.tail<3>().maxCoeff() > kOpenM * kOpenM) {
      return std::nullopt;
    }
    const SE3& T_old_new1 = solution.T_odom_cam;  // frames: the old camera stands for odom
    if (depth ? !agrees(old, T_old_new1, kSeen, agreement_needed(solution, matches.size()))
              : !seen(solution, matches.size(), kInliersWithoutDepth)) {
      return std::nullopt;
    }
    return LoopHypothesis{
        .edge = {.from = old.id,
                 .to = problem_.newest.id,
                 .T_from_to = T_old_new1,
                 .information = inverse(solution.covariance + of_two_views()),
                 .kind = EdgeKind::kLoop},
        .certain = depth && solution.visual_inliers >= kInliersBeyondDoubt &&
                   agrees(old, T_old_new1, kSeenBeyondDoubt, kAgreeingBeyondDoubt)};
  }

 private:
  [[nodiscard]] static bool seen(const PoseSolution& solution, std::size_t matches,
                                 std::uint32_t least) {
    return solution.visual_inliers >= least && static_cast<double>(solution.visual_inliers) >=
                                                   kInlierShare * static_cast<double>(matches);
  }

  /// The fewer points agree, the more of the depth has to.
  [[nodiscard]] static double agreement_needed(const PoseSolution& solution, std::size_t matches) {
    if (seen(solution, matches, kInliers)) {
      return kAgreeing;
    }
    return seen(solution, matches, kFewInliers) ? kAgreeingWithFew : kAgreeingBeyondDoubt;
  }

  [[nodiscard]] VisualMatch match(const LoopView& old, std::size_t in_new,
                                  std::size_t in_old) const {
    const PlaceView& seen = *problem_.newest.place;
    return {.p_odom = old.place->p_cam[in_old],  // frames: the old camera stands for odom
            .pixel = camera_.undistort(seen.features[in_new].pixel),
            .depth_m = seen.p_cam[in_new].z()};
  }

  [[nodiscard]] std::vector<VisualMatch> pairs(const LoopView& old) const {
    std::vector<VisualMatch> matches;
    for (const PlaceMatch& pair : match_places(*problem_.newest.place, *old.place)) {
      if (old.place->p_cam[pair.b].z() > 0) {
        matches.push_back(match(old, pair.a, pair.b));
      }
    }
    return matches;
  }

  /// By depth, where that goes no further than what few features leave uncertain.
  [[nodiscard]] SE3 registered(const LoopView& old, const SE3& T_old_new) const {
    constexpr double kFarM = 0.2;
    constexpr double kFarRad = 0.15;
    if (!problem_.newest.cloud || !old.cloud) {
      return T_old_new;
    }
    const RegistrationResult found =
        register_clouds(*problem_.newest.cloud, *old.cloud, T_old_new, problem_.gicp);
    const SE3& T_old_new1 = found.T_target_source;
    const Vector6d moved = (T_old_new.inverse() * T_old_new1).log();
    const bool near = moved.head<3>().norm() < kFarRad && moved.tail<3>().norm() < kFarM;
    return found.inliers > 0 && near ? T_old_new1 : T_old_new;
  }

  [[nodiscard]] std::vector<VisualMatch> guided(const LoopView& old, const SE3& T_old_new) const {
    const SE3 T_new_old = T_old_new.inverse();
    std::vector<ExpectedFeature> expected;
    std::vector<std::size_t> in_old;
    for (std::size_t i = 0; i < old.place->features.size(); ++i) {
      const Vector3d p_new = T_new_old * old.place->p_cam[i];  // frames: of the old camera
      if (old.place->p_cam[i].z() > 0 && p_new.z() > 0) {
        expected.push_back(
            {camera_.distort(camera_.project(p_new)), old.place->features[i].descriptor});
        in_old.push_back(i);
      }
    }
    const std::vector<int> found =
        match_by_projection(expected, problem_.newest.place->features, kGuidedPx);
    std::vector<VisualMatch> matches;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (found[i] >= 0) {
        matches.push_back(match(old, static_cast<std::size_t>(found[i]), in_old[i]));
      }
    }
    return matches;
  }

  [[nodiscard]] bool agrees(const LoopView& old, const SE3& T_old_new, double seen,
                            double agreeing) const {
    const auto enough = [&](const DepthAgreement& depth) {
      return depth.seen >= seen && depth.agreeing >= agreeing * depth.seen;
    };
    return enough(depth_agreement(*problem_.newest.cloud, *old.cloud, T_old_new)) &&
           enough(depth_agreement(*old.cloud, *problem_.newest.cloud, T_old_new.inverse()));
  }

  const LoopProblem& problem_;
  CameraModel camera_;
  PoseOptimiser optimiser_;
};

LoopView view_of(const Map& map, KeyframeId id, KeyframeId newest) {
  const Keyframe& keyframe = map.keyframe(id);
  const SE3& T_odom_this = keyframe.T_odom_cam;
  const SE3& T_odom_new = map.keyframe(newest).T_odom_cam;
  LoopView view{.id = id, .place = keyframe.place, .cloud = keyframe.cloud};
  if (!view.cloud && keyframe.stored_cloud) {
    view.cloud = keyframe.stored_cloud->read().value_or(nullptr);
  }
  if (map.same_part(id, newest)) {
    view.T_this_new = T_odom_this.inverse() * T_odom_new;
  }
  return view;
}

/// Length of the way between two keyframes [m].
double way_between(const Map& map, KeyframeId from, KeyframeId to) {
  double way_m = 0;
  auto it = map.keyframes().find(from);
  for (auto next = std::next(it); next != map.keyframes().end() && it->first < to; ++it, ++next) {
    way_m += (next->second.T_odom_cam.translation() - it->second.T_odom_cam.translation()).norm();
  }
  return way_m;
}

/// Old keyframes that look like the newest one, best first.
std::vector<PlaceCandidate> alike(const Map& map, const LocalMap& local) {
  const KeyframeId newest = local.newest();
  std::vector<PlaceCandidate> ranking =
      map.places().query(*map.keyframe(newest).place, map.places().size());
  double as_before = 0;  // the best of the keyframes that must look alike
  for (const PlaceCandidate& candidate : ranking) {
    if (candidate.keyframe != newest && ids_apart(candidate.keyframe, newest) <= kBefore) {
      as_before = std::max(as_before, candidate.score);
    }
  }
  std::erase_if(ranking, [&](const PlaceCandidate& candidate) {
    return candidate.keyframe > newest || candidate.score < kLeastAlike * as_before ||
           local.contains(candidate.keyframe);
  });
  return ranking;
}

/// Old keyframes whose depth the newest one should see, going by the way between, most first.
std::vector<PlaceCandidate> overlapping(const Map& map, const LocalMap& local) {
  const Keyframe& newest = map.keyframe(local.newest());
  if (!newest.cloud) {
    return {};
  }
  std::vector<PlaceCandidate> ranking;
  for (const auto& [id, overlap] :
       overlapping_keyframes(map, *newest.cloud, newest.T_odom_cam, kSeen)) {
    if (!local.contains(id)) {
      ranking.push_back({.keyframe = id, .score = overlap});
    }
  }
  return ranking;
}

/// What a loop says of where its new keyframe is.
SE3 pose_by(const Map& map, const RelativeEdge& loop) {
  const SE3& T_odom_from = map.keyframe(loop.from).T_odom_cam;
  const SE3& T_from_to = loop.T_from_to;
  return T_odom_from * T_from_to;
}

/// Between parts anything is possible.
bool is_possible(const Map& map, const RelativeEdge& loop) {
  if (!map.same_part(loop.from, loop.to)) {
    return true;
  }
  const double way_m = way_between(map, loop.from, loop.to);
  const SE3& T_odom_new = map.keyframe(loop.to).T_odom_cam;
  const SE3 T_odom_new1 = pose_by(map, loop);
  const Vector6d drift = (T_odom_new.inverse() * T_odom_new1).log();
  return drift.tail<3>().norm() < kDriftM + kDriftMPerM * way_m &&
         drift.head<3>().norm() < kDriftRad + kDriftRadPerM * way_m;
}

/// Whether a loop tells more than the way between its keyframes does.
bool is_news(const Map& map, const RelativeEdge& loop) {
  if (!map.same_part(loop.from, loop.to)) {
    return true;
  }
  const double way_m = way_between(map, loop.from, loop.to);
  const Matrix6d covariance = inverse(loop.information);
  return covariance.diagonal().tail<3>().maxCoeff() < kWayMPerM * kWayMPerM * way_m * way_m;
}

/// Whether two loops put the later's new keyframe at one place, by the way between them.
bool say_the_same(const Map& map, const RelativeEdge& a, const RelativeEdge& b) {
  if (!map.same_part(a.from, b.from) || !map.same_part(a.to, b.to)) {
    return false;
  }
  const SE3& T_odom_newa = map.keyframe(a.to).T_odom_cam;
  const SE3& T_odom_newb = map.keyframe(b.to).T_odom_cam;
  const SE3 T_odom_newb1 = pose_by(map, a) * (T_odom_newa.inverse() * T_odom_newb);
  const SE3 T_odom_newb2 = pose_by(map, b);
  const Vector6d apart = (T_odom_newb1.inverse() * T_odom_newb2).log();
  return apart.tail<3>().norm() < kSameM && apart.head<3>().norm() < kSameRad;
}

}  // namespace

LoopSolution verify_loops(const LoopProblem& problem) {
  const Verifier verifier{problem};
  LoopSolution solution;
  for (const LoopView& candidate : problem.candidates) {
    if (const auto found = verifier.compare(candidate)) {
      solution.found.push_back(*found);
    }
  }
  return solution;
}

std::shared_ptr<const LoopProblem> LoopCloser::problem(const Map& map, KeyframeId newest) const {
  if (!map.keyframe(newest).place) {
    return nullptr;
  }
  const LocalMap local{map, newest};
  auto problem = std::make_shared<LoopProblem>();
  std::vector<LoopView>& candidates = problem->candidates;
  for (const auto& ranking : {alike(map, local), overlapping(map, local)}) {
    for (const auto& [id, score] : peaks(ranking, kCandidates, kStretch)) {
      if (std::ranges::find(candidates, id, &LoopView::id) == candidates.end()) {
        candidates.push_back(view_of(map, id, newest));
      }
    }
  }
  problem->newest = view_of(map, newest, newest);
  problem->camera = camera_;
  problem->config = config_;
  problem->gicp = gicp_;
  return candidates.empty() ? nullptr : problem;
}

std::vector<RelativeEdge> LoopCloser::consider(const Map& map, const LoopSolution& solution) {
  std::vector<RelativeEdge> believed;
  for (const LoopHypothesis& found : solution.found) {
    if (!is_possible(map, found.edge) || !is_news(map, found.edge)) {
      continue;
    }
    std::erase_if(waiting_, [&](const LoopHypothesis& other) {
      return ids_apart(other.edge.to, found.edge.to) > kAmongLast;
    });
    std::map<KeyframeId, RelativeEdge> agreeing{{found.edge.to, found.edge}};
    for (const LoopHypothesis& other : waiting_) {
      if (say_the_same(map, other.edge, found.edge)) {
        agreeing.emplace(other.edge.to, other.edge);
      }
    }
    waiting_.push_back(found);
    if (believed.empty() && (found.certain || agreeing.size() >= kAgree)) {
      std::ranges::transform(
          agreeing, std::back_inserter(believed),
          [](const auto& keyframe_and_edge) { return keyframe_and_edge.second; });
    }
  }
  if (!believed.empty()) {
    waiting_.clear();
  }
  return believed;
}

}  // namespace geoflow::slam
