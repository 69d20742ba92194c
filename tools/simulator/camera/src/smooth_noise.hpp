#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"

namespace geoflow::simulator {

/// A random field over an image, of mean 0 and variance 1, that changes over some pixels: random
/// numbers on a grid of `pitch_x` by `pitch_y` pixels under cubic B-splines. Correlation falls to a
/// half at about one pitch. Const and thread-safe.
class SmoothNoise {
 public:
  /// `key` decides the field; a grid node's number depends on its place alone.
  SmoothNoise(std::uint64_t key, int width, int height, float pitch_x, float pitch_y);

  /// The field along row `y` in 0 … height - 1: `width` values.
  void row(int y, std::vector<float>& out) const;

 private:
  /// Where a place lies in the grid: the first of four nodes, their weights, and one over the root
  /// of the sum of the weights' squares.
  struct Weights {
    std::size_t first = 0;
    std::array<float, 4> weight{};
    float scale = 0;
  };
  [[nodiscard]] static Weights weights(float position) noexcept;

  /// Of kLanes pixels of a row; those beyond its end are of weight 0.
  struct Across {
    std::array<std::uint32_t, kLanes> first{};
    std::array<Lanes, 4> weight{};
    Lanes scale{};
  };
  /// The field of those pixels from a row of nodes, which is weighted down already.
  [[nodiscard]] static Lanes along_row(const Across& across, const float* nodes, float scale);

  std::size_t width_;
  float pitch_y_;
  std::size_t columns_ = 0;
  std::vector<float> nodes_;  ///< row by row
  std::vector<Across> across_;
};

}  // namespace geoflow::simulator
