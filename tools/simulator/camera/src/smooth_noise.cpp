#include "src/smooth_noise.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/random.hpp"

namespace geoflow::simulator {

SmoothNoise::Weights SmoothNoise::weights(float position) noexcept {
  constexpr float kSixth = 1.0F / 6.0F;
  constexpr float kFour = 4.0F;
  const float cell = std::floor(position);
  const float t = position - cell;
  const float s = 1.0F - t;
  // Each side's outer and inner weight.
  // NOLINTNEXTLINE(readability-magic-numbers): the uniform cubic B-spline
  const auto inner = [](float u) { return kSixth * (kFour - 6.0F * u * u + 3.0F * u * u * u); };
  Weights result{.first = static_cast<std::size_t>(cell),
                 .weight = {kSixth * s * s * s, inner(t), inner(s), kSixth * t * t * t}};
  float squares = 0;
  for (const float weight : result.weight) {
    squares += weight * weight;
  }
  result.scale = 1.0F / std::sqrt(squares);
  return result;
}

SmoothNoise::SmoothNoise(std::uint64_t key, int width, float pitch_x, float pitch_y)
    : key_{key}, pitch_y_{pitch_y} {
  for (int x = 0; x < width; ++x) {
    pixels_.push_back(weights(static_cast<float>(x) / pitch_x));
    columns_ = std::max(columns_, pixels_.back().first + 4);
  }
}

void SmoothNoise::row(int y, std::vector<float>& out) const {
  const Weights down = weights(static_cast<float>(y) / pitch_y_);
  std::vector<float> nodes(columns_);
  for (std::size_t k = 0; k < down.weight.size(); ++k) {
    const std::uint64_t row_key = subkey(key_, down.first + k);
    for (std::size_t column = 0; column < columns_; ++column) {
      nodes[column] += down.weight[k] * to_normal(scramble(row_key + column));
    }
  }
  out.resize(pixels_.size());
  for (std::size_t x = 0; x < pixels_.size(); ++x) {
    const Weights& across = pixels_[x];
    float sum = 0;
    for (std::size_t k = 0; k < across.weight.size(); ++k) {
      sum += across.weight[k] * nodes[across.first + k];
    }
    out[x] = sum * across.scale * down.scale;
  }
}

}  // namespace geoflow::simulator
