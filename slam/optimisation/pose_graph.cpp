#include "optimisation/pose_graph.hpp"

#include <cstddef>
#include <map>
#include <memory>
#include <vector>

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <ceres/types.h>

#include "geoflow/hal/geometry.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "optimisation/factors.hpp"

namespace geoflow::slam {
namespace {

constexpr double kCauchyWidth = 4.1;    ///< of six standard normals' norm, 99 % are below
constexpr double kContradicts = 22.46;  ///< chi-square of six degrees of freedom at 99.9 %
constexpr int kIterations = 50;

double chi_square(const RelativeEdge& edge, const SE3& T_odom_from, const SE3& T_odom_to) {
  const SE3& T_from_to = edge.T_from_to;
  const Vector6d error = (T_from_to.inverse() * (T_odom_from.inverse() * T_odom_to)).log();
  return error.dot(edge.information * error);
}

}  // namespace

PoseGraphSolution solve_pose_graph(const PoseGraphProblem& problem) {
  PoseManifold manifold;
  ceres::CauchyLoss loop_loss{kCauchyWidth};
  std::vector<std::unique_ptr<ceres::CostFunction>> factors;
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem ceres{ownership};

  std::vector<PoseBlock> poses;  // in one piece: see BundleAdjustment
  std::map<KeyframeId, std::size_t> index;
  poses.reserve(problem.nodes.size());
  for (const PoseGraphNode& node : problem.nodes) {
    index.emplace(node.id, poses.size());
    poses.push_back(to_block(node.T_odom_cam));
    ceres.AddParameterBlock(poses.back().data(), kPoseSize, &manifold);
  }
  const auto add = [&](const RelativeEdge& edge, ceres::LossFunction* loss) {
    factors.push_back(std::make_unique<RelativePoseFactor>(edge.T_from_to, edge.information));
    ceres.AddResidualBlock(factors.back().get(), loss, poses[index.at(edge.from)].data(),
                           poses[index.at(edge.to)].data());
  };
  for (const RelativeEdge& edge : problem.way) {
    add(edge, nullptr);
  }
  for (const RelativeEdge& edge : problem.loops) {
    add(edge, &loop_loss);
  }
  PoseGraphSolution solution;
  if (poses.empty()) {
    return solution;
  }
  ceres.SetParameterBlockConstant(poses.front().data());

  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = kIterations;
  options.num_threads = 1;  // threads would sum in another order each time
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres, &summary);

  solution.converged = summary.termination_type == ceres::CONVERGENCE;
  for (const PoseGraphNode& node : problem.nodes) {
    solution.T_odom_cam.emplace(node.id, from_block(poses[index.at(node.id)].data()));
  }
  for (const RelativeEdge& edge : problem.loops) {
    if (chi_square(edge, solution.T_odom_cam.at(edge.from), solution.T_odom_cam.at(edge.to)) >
        kContradicts) {
      solution.contradicted.emplace_back(edge.from, edge.to);
    }
  }
  return solution;
}

}  // namespace geoflow::slam
