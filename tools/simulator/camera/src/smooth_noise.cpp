#include "src/smooth_noise.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
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

SmoothNoise::SmoothNoise(std::uint64_t key, int width, int height, float pitch_x, float pitch_y)
    : width_{static_cast<std::size_t>(width)},
      pitch_y_{pitch_y},
      across_((width_ + kLanes - 1) / kLanes) {
  for (std::size_t x = 0; x < width_; ++x) {
    const Weights place = weights(static_cast<float>(x) / pitch_x);
    Across& across = across_[x / kLanes];
    const std::size_t lane = x % kLanes;
    across.first[lane] = static_cast<std::uint32_t>(place.first);
    for (std::size_t k = 0; k < place.weight.size(); ++k) {
      across.weight[k][lane] = place.weight[k];
    }
    across.scale[lane] = place.scale;
    columns_ = std::max(columns_, place.first + place.weight.size());
  }
  const Weights last = weights(static_cast<float>(height - 1) / pitch_y);
  for (std::size_t row = 0; row < last.first + last.weight.size(); ++row) {
    const std::uint64_t row_key = subkey(key, row);
    for (std::size_t column = 0; column < columns_; ++column) {
      nodes_.push_back(to_normal(scramble(row_key + column)));
    }
  }
}

Lanes SmoothNoise::along_row(const Across& across, const float* nodes, float scale) {
  Lanes field{};
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // A copy: GCC makes no vectors of what it loads through a constant reference in here.
    const Across places = across;
    Lanes sum{};
    for (std::size_t k = 0; k < places.weight.size(); ++k) {
      for (std::size_t i = 0; i < kLanes; ++i) {
        sum[i] += places.weight[k][i] * nodes[places.first[i] + k];
      }
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      field[i] = sum[i] * places.scale[i] * scale;
    }
  });
  return field;
}

void SmoothNoise::row(int y, std::vector<float>& out) const {
  const Weights down = weights(static_cast<float>(y) / pitch_y_);
  std::vector<float> blended(columns_);
  for (std::size_t k = 0; k < down.weight.size(); ++k) {
    for (std::size_t column = 0; column < columns_; ++column) {
      blended[column] += down.weight[k] * nodes_[(down.first + k) * columns_ + column];
    }
  }
  out.resize(width_);
  for (std::size_t x = 0; x < width_; x += kLanes) {
    const Lanes field = along_row(across_[x / kLanes], blended.data(), down.scale);
    std::copy_n(field.begin(), std::min(kLanes, width_ - x),
                out.begin() + static_cast<std::ptrdiff_t>(x));
  }
}

}  // namespace geoflow::simulator
