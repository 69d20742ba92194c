#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace geoflow::simulator {

/// A random field over an image, of mean 0 and variance 1, that changes over some pixels: random
/// numbers on a grid of `pitch_x` by `pitch_y` pixels under cubic B-splines. Correlation falls to a
/// half at about one pitch.
class SmoothNoise {
 public:
  /// `key` decides the field; a grid node's number depends on its place alone.
  SmoothNoise(std::uint64_t key, int width, float pitch_x, float pitch_y);

  /// The field along row `y`, `width` values.
  void row(int y, std::vector<float>& out) const;

 private:
  std::uint64_t key_;
  float pitch_y_;
  std::size_t columns_ = 0;
  /// For each pixel of a row: the first of four columns, their weights, and one over the
  /// root of the sum of the weights' squares.
  struct Weights {
    std::size_t first = 0;
    std::array<float, 4> weight{};
    float scale = 0;
  };
  [[nodiscard]] static Weights weights(float position) noexcept;
  std::vector<Weights> pixels_;
};

}  // namespace geoflow::simulator
