#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <ceres/types.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/stage.hpp"

#include "cloud/gicp.hpp"
#include "inertial/gyro_turn.hpp"
#include "inertial/up_direction.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/mapping_problem.hpp"
#include "optimisation/agreement.hpp"
#include "optimisation/factors.hpp"
#include "optimisation/matrix6.hpp"
#include "optimisation/pose_graph.hpp"
#include "place/loop_closer.hpp"
#include "vision/camera_model.hpp"

namespace geoflow::slam {
namespace {

constexpr double kCauchyWidth =
    2.0;  ///< of reprojection and depth residuals, in standard deviations
constexpr double kHuberWidth =
    2.5;  ///< of relative edges, in standard deviations of six dimensions

class BundleAdjustment {
 public:
  explicit BundleAdjustment(const MappingProblem& problem)
      : problem_{problem}, camera_{problem.camera} {}

  MappingSolution solve() {
    solution_ = std::make_unique<MappingSolution>();
    solution_->whole_map = problem_.whole_map;
    for (const MappingKeyframe& keyframe : problem_.keyframes) {
      index_.emplace(keyframe.id, blocks_.size());
      blocks_.push_back({.pose = to_block(keyframe.T_odom_cam), .bias = keyframe.gyro.bias});
    }
    measure_edges();
    estimate_pixel_sigma();
    add_keyframes();
    add_points();
    add_edges();
    add_upright();
    run();
    collect();
    return std::move(*solution_);
  }

 private:
  [[nodiscard]] const MappingKeyframe& keyframe(KeyframeId id) const {
    return problem_.keyframes[index_.at(id)];
  }
  PoseBlock& pose(KeyframeId id) { return blocks_[index_.at(id)].pose; }
  [[nodiscard]] const PoseBlock& pose(KeyframeId id) const { return blocks_[index_.at(id)].pose; }
  Vector3d& bias(KeyframeId id) { return blocks_[index_.at(id)].bias; }

  void measure_edges() {
    for (const EdgeToMeasure& pair : problem_.edges_to_measure) {
      const MappingKeyframe& a = keyframe(pair.from);
      const MappingKeyframe& b = keyframe(pair.to);
      const RegistrationResult found =
          register_clouds(*b.cloud, *a.cloud, a.T_odom_cam.inverse() * b.T_odom_cam, problem_.gicp);
      if (found.converged) {
        solution_->measured.push_back(
            {pair.from, pair.to, found.T_target_source, believable(found, pair.reckoned)});
      }
    }
  }

  /// The information of a registration, but for what contradicts legs and IMU: depth of what walks.
  static Matrix6d believable(const RegistrationResult& found,
                             const std::optional<RelativeEdge>& reckoned) {
    if (!reckoned) {
      return found.information;
    }
    const SE3 T_to_from = reckoned->T_from_to.inverse();
    const SE3& T_from_to = found.T_target_source;
    const Vector6d off = (T_to_from * T_from_to).log();
    const Matrix6d agreed =
        agreeing(found.information, -found.information * off, inverse(reckoned->information));
    return agreed.transpose() * found.information * agreed;
  }

  [[nodiscard]] Vector2d residual(const Observation& observation, const Vector3d& p_odom) const {
    const Vector3d p_cam = from_block(pose(observation.keyframe).data()).inverse() * p_odom;
    return camera_.project(p_cam) - observation.pixel;
  }

  /// Whether a point is where the observing keyframe can see it. One that is not has no residual to
  /// begin with, for want of which Ceres would adjust nothing at all; collect() takes it for an
  /// outlier.
  [[nodiscard]] bool in_front(const Observation& observation, const Vector3d& p_odom) const {
    const SE3 T_cam_odom = from_block(pose(observation.keyframe).data()).inverse();
    return (T_cam_odom * p_odom).z() >= kMinimumDepthM;
  }

  /// As in single-frame optimisation: the visual noise is what the residuals say it is.
  void estimate_pixel_sigma() {
    constexpr double kMedianOfRayleigh = 1.17741;
    std::vector<double> norms;
    for (const MappingPoint& point : problem_.points) {
      if (point.observations.size() > 1) {
        for (const Observation& observation : point.observations) {
          norms.push_back(residual(observation, point.p_odom).norm());
        }
      }
    }
    sigma_px_ = problem_.pose.pixel_sigma;
    if (!norms.empty()) {
      const auto middle = norms.begin() + static_cast<std::ptrdiff_t>(norms.size() / 2);
      std::nth_element(norms.begin(), middle, norms.end());
      sigma_px_ = std::max(sigma_px_, *middle / kMedianOfRayleigh);
    }
  }

  template <typename Factor, typename... Args>
  void add_factor(ceres::LossFunction* loss, const std::vector<double*>& blocks,
                  const Args&... args) {
    factors_.push_back(std::make_unique<Factor>(args...));
    ceres_.AddResidualBlock(factors_.back().get(), loss, blocks);
  }

  void add_keyframes() {
    for (const MappingKeyframe& keyframe : problem_.keyframes) {
      double* block = pose(keyframe.id).data();
      ceres_.AddParameterBlock(block, kPoseSize, &manifold_);
      ordering_->AddElementToGroup(block, 1);
      if (keyframe.fixed) {
        ceres_.SetParameterBlockConstant(block);
      }
    }
  }

  void add_points() {
    points_.reserve(problem_.points.size());
    for (const MappingPoint& point : problem_.points) {
      points_.push_back(point.p_odom);
      double* block = points_.back().data();
      ceres_.AddParameterBlock(block, 3);
      ordering_->AddElementToGroup(block, 0);
      for (const Observation& observation : point.observations) {
        if (!in_front(observation, point.p_odom)) {
          continue;
        }
        double* pose_block = pose(observation.keyframe).data();
        add_factor<ReprojectionFactor>(&visual_loss_, {pose_block, block}, camera_,
                                       observation.pixel, sigma_px_);
        if (observation.depth_m > 0) {
          add_factor<PointDepthFactor>(&visual_loss_, {pose_block, block}, observation.depth_m,
                                       problem_.mapping.inverse_depth_sigma);
        }
      }
    }
  }

  void add_edges() {
    const auto add = [&](const RelativeEdge& edge) {
      add_factor<RelativePoseFactor>(&edge_loss_, {pose(edge.from).data(), pose(edge.to).data()},
                                     edge.T_from_to, edge.information);
    };
    for (const RelativeEdge& edge : problem_.edges) {
      if (edge.kind == EdgeKind::kReckoned && keyframe(edge.to).gyro.duration_s > 0) {
        add_reckoned(edge);
      } else {
        add(edge);
      }
    }
    std::ranges::for_each(solution_->measured, add);
  }

  /// Keeps the window upright, as the newest keyframe knows the accelerometer's bias. What else the
  /// IMU errs by in one keyframe's tilt, it errs by in those about it: all of them count as one.
  void add_upright() {
    const auto newest = std::ranges::find_if(problem_.keyframes.rbegin(), problem_.keyframes.rend(),
                                             [](const auto& k) { return k.up.has_value(); });
    if (!problem_.up_odom || newest == problem_.keyframes.rend()) {
      return;
    }
    const UpDirection& known = *newest->up;
    const Vector3d up_odom = problem_.up_odom->given(known.bias);
    for (const MappingKeyframe& keyframe : problem_.keyframes) {
      if (!keyframe.up || keyframe.fixed) {
        continue;
      }
      const UpDirection felt = keyframe.up->seen_from(keyframe.T_odom_cam.rotation_matrix());
      const Matrix3d by_bias = felt.per_bias - problem_.up_odom->per_bias;
      const double variance = felt.variance + problem_.up_odom->variance +
                              (by_bias * known.bias_covariance * by_bias.transpose()).trace() / 2;
      add_factor<UprightFactor>(&edge_loss_, {pose(keyframe.id).data()},
                                keyframe.up->given(known.bias), up_odom,
                                std::sqrt(problem_.mapping.window * variance));
    }
  }

  /// The motion to a keyframe with the gyroscope's bias on the way, which is much the same as on
  /// the way before; the first one's is what was known then.
  void add_reckoned(const RelativeEdge& edge) {
    const GyroTurn& before = keyframe(edge.from).gyro;
    const GyroTurn& gyro = keyframe(edge.to).gyro;
    double* const bias = add_bias(edge.to);
    add_factor<ReckonedFactor>(&edge_loss_, {pose(edge.from).data(), pose(edge.to).data(), bias},
                               edge.T_from_to, edge.information, gyro);
    if (before.duration_s > 0) {
      const double apart_s = 0.5 * (before.duration_s + gyro.duration_s);
      add_factor<BiasWalkFactor>(nullptr, {add_bias(edge.from), bias},
                                 problem_.gyro_random_walk * std::sqrt(apart_s));
    } else if (!keyframe(edge.to).fixed) {
      add_factor<BiasPriorFactor>(nullptr, {bias}, gyro.bias, gyro.bias_covariance);
    }
  }

  double* add_bias(KeyframeId id) {
    double* const block = bias(id).data();
    if (!ceres_.HasParameterBlock(block)) {
      ceres_.AddParameterBlock(block, 3);
      ordering_->AddElementToGroup(block, 1);
      if (keyframe(id).fixed) {
        ceres_.SetParameterBlockConstant(block);
      } else {
        moving_biases_.push_back(id);
      }
    }
    return block;
  }

  void run() {
    ceres::Solver::Options options;
    options.linear_solver_type = problem_.whole_map ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    options.linear_solver_ordering = ordering_;
    options.max_num_iterations = problem_.mapping.iterations;
    options.num_threads = 1;  // threads would sum in another order each time
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &ceres_, &summary);
  }

  void collect() {
    constexpr double kChi2Of2At99Percent = 9.21;
    for (const MappingKeyframe& keyframe : problem_.keyframes) {
      if (!keyframe.fixed) {
        solution_->T_odom_cam.emplace(keyframe.id, from_block(pose(keyframe.id).data()));
      }
    }
    for (const KeyframeId id : moving_biases_) {
      solution_->gyro_bias.emplace(id, bias(id));
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const MappingPoint& point = problem_.points[i];
      solution_->p_odom.emplace(point.id, points_[i]);
      for (const Observation& observation : point.observations) {
        const double chi2 =
            residual(observation, points_[i]).squaredNorm() / (sigma_px_ * sigma_px_);
        if (!in_front(observation, points_[i]) || !(chi2 < kChi2Of2At99Percent)) {
          solution_->outliers.emplace_back(point.id, observation.keyframe);
        }
      }
    }
  }

  const MappingProblem& problem_;
  CameraModel camera_;
  std::map<KeyframeId, std::size_t> index_;
  /// What is adjusted of a keyframe.
  struct KeyframeBlocks {
    PoseBlock pose{};
    Vector3d bias;  ///< GyroTurn::bias
  };
  /// In the problem's order, in one piece: Ceres orders the blocks of a group by their addresses,
  /// and the order of a sum decides its last bits.
  std::vector<KeyframeBlocks> blocks_;
  std::vector<KeyframeId> moving_biases_;
  std::vector<Vector3d> points_;
  double sigma_px_ = 1;
  std::unique_ptr<MappingSolution> solution_;
  PoseManifold manifold_;
  ceres::CauchyLoss visual_loss_{kCauchyWidth};
  ceres::HuberLoss edge_loss_{kHuberWidth};
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_ =
      std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<std::unique_ptr<ceres::CostFunction>> factors_;
  ceres::Problem ceres_{keep_ownership()};

  static ceres::Problem::Options keep_ownership() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }
};

}  // namespace

MappingResult optimise(const MappingTask& task, StageObserver* observer) {
  const bool whole_map = task.problem && task.problem->whole_map;
  const StageScope scope{observer, whole_map ? Stage::kGlobalMapping : Stage::kMapping};
  MappingResult result{.solution = nullptr, .revision = task.revision};
  if (task.problem) {
    result.solution =
        std::make_shared<const MappingSolution>(BundleAdjustment{*task.problem}.solve());
  }
  if (task.loops) {
    result.loops = std::make_shared<const LoopSolution>(verify_loops(*task.loops));
  }
  if (task.graph) {
    result.graph = std::make_shared<const PoseGraphSolution>(solve_pose_graph(*task.graph));
  }
  return result;
}

}  // namespace geoflow::slam
