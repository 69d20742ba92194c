#include "geoflow/tools/evaluate/association.hpp"

#include <chrono>
#include <cstddef>
#include <iterator>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

/// Indices into the shorter and the longer trajectory.
struct Match {
  std::size_t shorter = 0;
  std::size_t longer = 0;
  Duration difference{};
};

/// The pose of `poses` nearest in time to `t`; the earlier of two equally near ones. Not empty.
std::size_t nearest(const Trajectory& poses, HostTime t) {
  const auto after = std::ranges::lower_bound(poses, t, {}, &StampedPose::t);
  if (after == poses.begin()) {
    return 0;
  }
  const auto before = std::prev(after);
  const bool take_after = after != poses.end() && after->t - t < t - before->t;
  return static_cast<std::size_t>(std::distance(poses.begin(), take_after ? after : before));
}

/// Nearest pose of `longer` for each of `shorter`, both in order, so equal choices stand side by
/// side.
std::vector<Match> match(const Trajectory& shorter, const Trajectory& longer, Duration shift,
                         Duration max_difference) {
  std::vector<Match> matches;
  for (std::size_t i = 0; i < shorter.size(); ++i) {
    const HostTime t = shorter[i].t + shift;
    const std::size_t j = nearest(longer, t);
    const Match candidate{
        .shorter = i, .longer = j, .difference = std::chrono::abs(longer[j].t - t)};
    if (candidate.difference > max_difference) {
      continue;
    }
    if (matches.empty() || matches.back().longer != j) {
      matches.push_back(candidate);
    } else if (candidate.difference < matches.back().difference) {
      matches.back() = candidate;
    }
  }
  return matches;
}

tl::unexpected<Error> no_pair(const Trajectory& estimate, const Trajectory& reference,
                              const AssociationOptions& options) {
  const auto seconds = [](HostTime t) { return to_seconds(t.time_since_epoch()); };
  return fail(
      ErrorCode::kInvalidData,
      "no pose of the estimate ({:.3f} s to {:.3f} s, offset {:.3f} s included) has one of the "
      "reference ({:.3f} s to {:.3f} s) within {:.3f} s: give the offset of the clocks "
      "or a larger difference",
      seconds(estimate.front().t + options.offset), seconds(estimate.back().t + options.offset),
      to_seconds(options.offset), seconds(reference.front().t), seconds(reference.back().t),
      to_seconds(options.max_difference));
}

}  // namespace

Result<PosePairs> associate(const Trajectory& estimate, const Trajectory& reference,
                            const AssociationOptions& options) {
  if (estimate.empty() || reference.empty()) {
    return fail(ErrorCode::kInvalidData, "the {} holds no pose",
                estimate.empty() ? "estimate" : "reference");
  }
  if (options.max_difference < Duration{0}) {
    return fail(ErrorCode::kInvalidArgument, "the largest time difference must not be negative");
  }
  if (std::chrono::abs(options.offset) > kMaxOffset) {
    return fail(ErrorCode::kInvalidArgument, "the time offset must be within {} s of zero",
                std::chrono::duration_cast<std::chrono::seconds>(kMaxOffset).count());
  }
  // A tie goes to the estimate as the longer one, as in evo.
  const bool estimate_is_shorter = estimate.size() < reference.size();
  const auto matches = estimate_is_shorter
                           ? match(estimate, reference, options.offset, options.max_difference)
                           : match(reference, estimate, -options.offset, options.max_difference);
  if (matches.empty()) {
    return no_pair(estimate, reference, options);
  }
  PosePairs pairs;
  pairs.reserve(matches.size());
  for (const Match& found : matches) {
    const StampedPose& est = estimate[estimate_is_shorter ? found.shorter : found.longer];
    const StampedPose& ref = reference[estimate_is_shorter ? found.longer : found.shorter];
    pairs.push_back({.t = est.t + options.offset, .estimate = est.pose, .reference = ref.pose});
  }
  return pairs;
}

Result<PosePairs> associate(const TrajectoryFile& estimate, const TrajectoryFile& reference,
                            const AssociationOptions& options) {
  const bool estimate_timed = estimate.format != TrajectoryFormat::kKitti;
  const bool reference_timed = reference.format != TrajectoryFormat::kKitti;
  if (estimate_timed != reference_timed) {
    return fail(
        ErrorCode::kInvalidArgument,
        "the {} is a KITTI file, which has no times, but the {} has times: they cannot be paired",
        estimate_timed ? "reference" : "estimate", estimate_timed ? "estimate" : "reference");
  }
  if (estimate_timed) {
    return associate(estimate.poses, reference.poses, options);
  }
  if (estimate.poses.size() != reference.poses.size()) {
    return fail(ErrorCode::kInvalidData,
                "KITTI files are paired line by line, but the estimate has {} poses and the "
                "reference {}",
                estimate.poses.size(), reference.poses.size());
  }
  auto pairs = associate(estimate.poses, reference.poses, {.max_difference = Duration{0}});
  if (pairs && pairs->size() == estimate.matrices.size() &&
      pairs->size() == reference.matrices.size()) {
    for (std::size_t i = 0; i < pairs->size(); ++i) {
      (*pairs)[i].R_estimate = estimate.matrices[i];
      (*pairs)[i].R_reference = reference.matrices[i];
    }
  }
  return pairs;
}

}  // namespace geoflow::tools
