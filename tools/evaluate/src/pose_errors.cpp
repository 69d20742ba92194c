#include "geoflow/tools/evaluate/pose_errors.hpp"

#include <algorithm>
#include <cstddef>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools {
namespace {

double position_error(const PosePair& pair) {
  return (pair.estimate.translation() - pair.reference.translation()).norm();
}

}  // namespace

PoseErrors absolute_errors(const PosePairs& pairs) {
  PoseErrors errors;
  for (const PosePair& pair : pairs) {
    errors.translation_m.push_back(position_error(pair));
    errors.rotation_rad.push_back(
        pair.reference.rotation().angularDistance(pair.estimate.rotation()));
  }
  return errors;
}

PoseErrors relative_errors(const PosePairs& pairs, const IndexPairs& stretches) {
  PoseErrors errors;
  for (const auto& [i, j] : stretches) {
    const PosePair& first = pairs[i];
    const PosePair& last = pairs[j];
    const Vector3d reference_motion =
        first.R_reference.transpose() *
        (last.reference.translation() - first.reference.translation());
    const Vector3d estimate_motion =
        first.R_estimate.transpose() * (last.estimate.translation() - first.estimate.translation());
    const Matrix3d R_reference_motion = first.R_reference.transpose() * last.R_reference;
    errors.translation_m.push_back(
        (R_reference_motion.transpose() * (estimate_motion - reference_motion)).norm());
    const SE3 error = (first.reference.inverse() * last.reference).inverse() *
                      (first.estimate.inverse() * last.estimate);
    errors.rotation_rad.push_back(so3::log(error.rotation()).norm());
  }
  return errors;
}

double correct_rate(const PosePairs& pairs, HostTime begin, HostTime end,
                    const CoverageOptions& options) {
  if (end <= begin) {
    return 1.0;
  }
  Duration covered{0};
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (options.max_error_m && position_error(pairs[k]) > *options.max_error_m) {
      continue;
    }
    const HostTime next = k + 1 < pairs.size() ? pairs[k + 1].t : end;
    const HostTime from = std::clamp(pairs[k].t, begin, end);
    const HostTime to = std::clamp(next, begin, end);
    covered += std::min(std::max(to - from, Duration{0}), options.max_gap);
  }
  return to_seconds(covered) / to_seconds(end - begin);
}

PathLengths path_lengths(const PosePairs& pairs) {
  PathLengths lengths;
  for (std::size_t k = 1; k < pairs.size(); ++k) {
    lengths.estimate_m +=
        (pairs[k].estimate.translation() - pairs[k - 1].estimate.translation()).norm();
    lengths.reference_m +=
        (pairs[k].reference.translation() - pairs[k - 1].reference.translation()).norm();
  }
  return lengths;
}

}  // namespace geoflow::tools
