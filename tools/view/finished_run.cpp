#include "view/finished_run.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

/// To six digits, which is what can be seen.
double shortened(double value) {
  constexpr double kSteps = 1e6;
  return std::round(value * kSteps) / kSteps;
}

json numbers(const Vector3d& vector) {
  return {shortened(vector.x()), shortened(vector.y()), shortened(vector.z())};
}

/// x y z of the position and x y z w of the rotation.
json numbers(const SE3& pose) {
  json list = numbers(pose.translation());
  const Eigen::Quaterniond& q = pose.rotation();
  for (const double value : {q.x(), q.y(), q.z(), q.w()}) {
    list.push_back(shortened(value));
  }
  return list;
}

/// The upper triangle of the position's covariance in the map, of a perturbation in the base's
/// frame (geometry.hpp).
json position_covariance(const Matrix6d& covariance, const SE3& T_map_base) {
  const Matrix3d R_map_base = T_map_base.rotation_matrix();
  const Matrix3d in_map =
      R_map_base * covariance.bottomRightCorner<3, 3>() * R_map_base.transpose();
  json list = json::array();
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = row; column < 3; ++column) {
      list.push_back(in_map(row, column));
    }
  }
  return list;
}

json frames_of(const std::vector<PoseEstimate>& estimates, const Trajectory& live) {
  json frames = json::array();
  auto pose = live.begin();
  for (const PoseEstimate& estimate : estimates) {
    while (pose != live.end() && pose->t < estimate.t) {
      ++pose;
    }
    if (pose == live.end()) {
      break;
    }
    if (pose->t == estimate.t) {
      const Duration since_first = estimate.t - estimates.front().t;
      frames.push_back({{"t_s", to_seconds(since_first)},
                        {"pose", numbers(pose->pose)},
                        {"status", to_string(estimate.status)},
                        {"source", to_string(estimate.source)},
                        {"quality", estimate.quality},
                        {"covariance", position_covariance(estimate.covariance, pose->pose)}});
    }
  }
  return frames;
}

}  // namespace

Result<json> read_finished_run(const std::filesystem::path& folder) {
  const auto estimates = read_estimates(folder / "estimates.csv");
  const auto live = estimates ? read_trajectory(folder / "live_base.txt", TrajectoryFormat::kTum)
                              : tl::unexpected{estimates.error()};
  const auto final = live ? read_trajectory(folder / "final_base.txt", TrajectoryFormat::kTum)
                          : tl::unexpected{live.error()};
  if (!final) {
    return tl::unexpected{final.error()};
  }
  json frames = frames_of(*estimates, live->poses);
  if (frames.empty()) {
    return fail(ErrorCode::kInvalidData,
                "{}: live_base.txt has no pose at the times of estimates.csv", folder.string());
  }
  json way = json::array();
  for (const auto& pose : final->poses) {
    way.push_back(numbers(pose.pose.translation()));
  }
  return json{{"name", std::filesystem::absolute(folder).lexically_normal().string()},
              {"frames", std::move(frames)},
              {"final", std::move(way)}};
}

}  // namespace geoflow::tools
