#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <ceres/cost_function.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"

#include "optimisation/factors.hpp"

namespace geoflow::slam {

/// The factor's Jacobian by a block's tangent against central differences along it.
inline void expect_jacobians(const ceres::CostFunction& factor,
                             std::vector<std::vector<double>> blocks) {
  constexpr double kStep = 1e-6;
  const PoseManifold manifold;
  const int rows = factor.num_residuals();
  std::vector<const double*> parameters;
  std::vector<std::vector<double>> storage;
  std::vector<double*> jacobians;
  storage.reserve(blocks.size());
  for (const auto& block : blocks) {
    parameters.push_back(block.data());
    storage.emplace_back(static_cast<std::size_t>(rows) * block.size());
    jacobians.push_back(storage.back().data());
  }
  Eigen::VectorXd residuals{rows};
  ASSERT_TRUE(factor.Evaluate(parameters.data(), residuals.data(), jacobians.data()));
  const auto residuals_at = [&](std::size_t block, int column, double step) {
    std::vector<std::vector<double>> moved = blocks;
    if (blocks[block].size() == kPoseSize) {
      Vector6d delta = step * Vector6d::Unit(column);
      EXPECT_TRUE(manifold.Plus(blocks[block].data(), delta.data(), moved[block].data()));
    } else {
      moved[block][static_cast<std::size_t>(column)] += step;
    }
    std::vector<const double*> at;
    at.reserve(moved.size());
    for (const auto& values : moved) {
      at.push_back(values.data());
    }
    Eigen::VectorXd result{rows};
    EXPECT_TRUE(factor.Evaluate(at.data(), result.data(), nullptr));
    return result;
  };
  for (std::size_t block = 0; block < blocks.size(); ++block) {
    const auto size = static_cast<int>(blocks[block].size());
    const Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J{
        storage[block].data(), rows, size};
    const int tangent = size == kPoseSize ? kPoseTangentSize : size;
    for (int column = 0; column < tangent; ++column) {
      const Eigen::VectorXd numeric =
          (residuals_at(block, column, kStep) - residuals_at(block, column, -kStep)) / (2 * kStep);
      EXPECT_LT((numeric - J.col(column)).norm(), 1e-5 * (1 + numeric.norm()))
          << "block " << block << " column " << column;
    }
  }
}

inline std::vector<double> block_of(const SE3& T) {
  const PoseBlock block = to_block(T);
  return {block.begin(), block.end()};
}

}  // namespace geoflow::slam
