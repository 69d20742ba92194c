#include "geoflow/tools/simulator/texture.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "geoflow/tools/simulator/random.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kLargestCode = 255.0F;
constexpr unsigned kByte = 8;
constexpr std::size_t kContrastOctaves = 3;

std::vector<Rgb> halved(const std::vector<Rgb>& pixels, std::size_t side) {
  constexpr float kQuarter = 0.25F;
  const std::size_t half = side / 2;
  std::vector<Rgb> result(half * half);
  for (std::size_t y = 0; y < half; ++y) {
    for (std::size_t x = 0; x < half; ++x) {
      const std::size_t at = 2 * y * side + 2 * x;
      result[y * half + x] =
          kQuarter * (pixels[at] + pixels[at + 1] + pixels[at + side] + pixels[at + side + 1]);
    }
  }
  return result;
}

float luminance_variance(const std::vector<Rgb>& pixels) {
  double sum = 0;
  double squares = 0;
  for (const Rgb& pixel : pixels) {
    const double value = static_cast<double>(luminance(pixel));
    sum += value;
    squares += value * value;
  }
  const double count = static_cast<double>(pixels.size());
  const double mean = sum / count;
  return static_cast<float>(std::max(0.0, squares / count - mean * mean));
}

/// The four bytes of a texel as numbers, the lowest first.
Rgb decode(std::uint32_t texel) noexcept {
  using Bytes = std::uint8_t __attribute__((vector_size(4)));
  return __builtin_convertvector(std::bit_cast<Bytes>(texel), Rgb);
}

int to_cell(float coordinate) noexcept {
  const int truncated = static_cast<int>(coordinate);
  return truncated - (coordinate < static_cast<float>(truncated) ? 1 : 0);
}

}  // namespace

Texture::Texture(const std::vector<Rgb>& pixels, int side, float length_m, Repeat repeat)
    : length_m_{length_m}, inverse_length_{1.0F / length_m}, repeat_{repeat} {
  constexpr float kSmallestUnit = 1e-6F;
  Rgb largest{};
  for (const Rgb& pixel : pixels) {
    for (int c = 0; c < 3; ++c) {
      largest[c] = std::max(largest[c], pixel[c]);
    }
  }
  for (int c = 0; c < 3; ++c) {
    unit_[c] = std::max(largest[c], kSmallestUnit) / kLargestCode;
  }
  std::vector<float> variances;
  std::vector<Rgb> level = pixels;
  for (int length = side; length >= 1; length /= 2) {
    variances.push_back(luminance_variance(level));
    Level coded{.side = length, .texels = std::vector<std::uint32_t>(level.size())};
    for (std::size_t i = 0; i < level.size(); ++i) {
      for (int c = 2; c >= 0; --c) {
        const float code = std::clamp(level[i][c] / unit_[c] + 0.5F, 0.0F, kLargestCode);
        coded.texels[i] = (coded.texels[i] << kByte) | static_cast<std::uint32_t>(code);
      }
    }
    levels_.push_back(std::move(coded));
    if (length > 1) {
      level = halved(level, static_cast<std::size_t>(length));
    }
  }
  mean_ = level.front();
  const float mean_luminance = std::max(luminance(mean_), kSmallestUnit);
  for (std::size_t i = 0; i < variances.size(); ++i) {
    const std::size_t coarse = std::min(i + kContrastOctaves, variances.size() - 1);
    contrasts_.push_back(std::sqrt(std::max(0.0F, variances[i] - variances[coarse])) /
                         mean_luminance);
  }
}

Rgb Texture::bilinear(std::size_t index, float u, float v) const noexcept {
  const Level& level = levels_[index];
  const float side = static_cast<float>(level.side);
  const float x = u * side - 0.5F;
  const float y = v * side - 0.5F;
  const int x0 = to_cell(x);
  const int y0 = to_cell(y);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const int last = level.side - 1;
  const auto wrap = [&](int cell) {
    return static_cast<std::size_t>(repeat_ == Repeat::kClamp ? std::clamp(cell, 0, last)
                                                              : cell & last);
  };
  const auto row_length = static_cast<std::size_t>(level.side);
  const std::uint32_t* top = level.texels.data() + wrap(y0) * row_length;
  const std::uint32_t* bottom = level.texels.data() + wrap(y0 + 1) * row_length;
  const std::size_t left = wrap(x0);
  const std::size_t right = wrap(x0 + 1);
  return (decode(top[left]) * (1.0F - fx) + decode(top[right]) * fx) * (1.0F - fy) +
         (decode(bottom[left]) * (1.0F - fx) + decode(bottom[right]) * fx) * fy;
}

float Texture::level_of(float footprint_m) const noexcept {
  // log2 from the exponent and a linear mantissa: within 0.09 of it, and continuous.
  constexpr float kMantissa = 1.0F / 8388608.0F;  // 2^-23: IEEE 754 single precision
  constexpr float kBias = 127.0F;
  const float texels = footprint_m * inverse_length_ * static_cast<float>(levels_.front().side);
  const float scaled =
      static_cast<float>(std::bit_cast<std::uint32_t>(std::max(texels, 1.0F))) * kMantissa - kBias;
  return std::min(scaled, static_cast<float>(levels_.size() - 1));
}

void Texture::turn(float& u, float& v) const noexcept {
  if (repeat_ != Repeat::kShuffle) {
    return;
  }
  const int column = to_cell(u);
  const int row = to_cell(v);
  u -= static_cast<float>(column);
  v -= static_cast<float>(row);
  const std::uint64_t turns = subkey(static_cast<std::uint64_t>(static_cast<std::uint32_t>(column)),
                                     static_cast<std::uint32_t>(row)) &
                              3U;
  if ((turns & 1U) != 0) {
    const float old_u = u;
    u = v;
    v = 1.0F - old_u;
  }
  if ((turns & 2U) != 0) {
    u = 1.0F - u;
    v = 1.0F - v;
  }
}

Rgb Texture::sample_quickly(float u_m, float v_m, float footprint_m) const noexcept {
  float u = u_m * inverse_length_;
  float v = 1.0F - v_m * inverse_length_;
  turn(u, v);
  return bilinear(static_cast<std::size_t>(level_of(footprint_m) + 0.5F), u, v) * unit_;
}

Rgb Texture::sample(float u_m, float v_m, float footprint_m) const noexcept {
  float u = u_m * inverse_length_;
  float v = 1.0F - v_m * inverse_length_;  // row 0 is the picture's top
  turn(u, v);
  const float level = level_of(footprint_m);
  const auto fine = static_cast<std::size_t>(level);
  const float blend = level - static_cast<float>(fine);
  Rgb result = bilinear(fine, u, v);
  if (blend > 0.0F && fine + 1 < levels_.size()) {
    result = result * (1.0F - blend) + bilinear(fine + 1, u, v) * blend;
  }
  return result * unit_;
}

float Texture::contrast(float footprint_m) const noexcept {
  const float level = level_of(footprint_m);
  const auto fine = static_cast<std::size_t>(level);
  const std::size_t coarse = std::min(fine + 1, contrasts_.size() - 1);
  const float blend = level - static_cast<float>(fine);
  return contrasts_[fine] * (1.0F - blend) + contrasts_[coarse] * blend;
}

}  // namespace geoflow::simulator
