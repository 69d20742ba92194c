#include "geoflow/tools/simulator/texture.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kLargestCode = 255.0F;
constexpr int kByte = 8;
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
    const auto value = static_cast<double>(luminance(pixel));
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(pixels.size());
  const double mean = sum / count;
  return static_cast<float>(std::max(0.0, squares / count - mean * mean));
}

/// The bytes of a texel as numbers, each where it stands: times 1, 2^8, 2^16.
[[gnu::always_inline]] inline Rgb decode(std::uint32_t texel) noexcept {
  using Words = std::uint32_t __attribute__((vector_size(16)));
  using Integers = std::int32_t __attribute__((vector_size(16)));
  constexpr Words kBytes{0xff, 0xff00, 0xff0000, 0};
  const Words all{texel, texel, texel, texel};
  return __builtin_convertvector(std::bit_cast<Integers>(all & kBytes), Rgb);
}

}  // namespace

Texture::Texture(const std::vector<Rgb>& pixels, int side, float length_m, Repeat repeat)
    : length_m_{length_m}, inverse_length_{1.0F / length_m}, repeat_{repeat}, side_{side} {
  constexpr float kSmallestUnit = 1e-6F;
  Rgb largest{};
  for (const Rgb& pixel : pixels) {
    for (int c = 0; c < 3; ++c) {
      largest[c] = std::max(largest[c], pixel[c]);
    }
  }
  Rgb unit{};
  for (int c = 0; c < 3; ++c) {
    unit[c] = std::max(largest[c], kSmallestUnit) / kLargestCode;
    unit_[c] = std::ldexp(unit[c], -kByte * c);
  }
  std::vector<float> variances;
  std::vector<Rgb> level = pixels;
  for (int length = side; length >= 1; length /= 2) {
    variances.push_back(luminance_variance(level));
    first_.at(variances.size() - 1) = static_cast<std::uint32_t>(texels_.size());
    for (const Rgb& pixel : level) {
      std::uint32_t texel = 0;
      for (int c = 2; c >= 0; --c) {
        const float code = std::clamp(pixel[c] / unit[c] + 0.5F, 0.0F, kLargestCode);
        texel = (texel << kByte) | static_cast<std::uint32_t>(code);
      }
      texels_.push_back(texel);
    }
    if (length > 1) {
      level = halved(level, static_cast<std::size_t>(length));
    }
  }
  last_level_ = static_cast<int>(variances.size()) - 1;
  mean_ = level.front();
  const float mean_luminance = std::max(luminance(mean_), kSmallestUnit);
  for (std::size_t i = 0; i < variances.size(); ++i) {
    const std::size_t coarse = std::min(i + kContrastOctaves, variances.size() - 1);
    contrasts_.push_back(std::sqrt(std::max(0.0F, variances[i] - variances[coarse])) /
                         mean_luminance);
  }
}

[[gnu::always_inline]] inline float Texture::level_of(float footprint_m) const noexcept {
  // log2 from the exponent and a linear mantissa: within 0.09 of it, and continuous.
  constexpr float kMantissa = 1.0F / 8388608.0F;  // 2^-23: IEEE 754 single precision
  constexpr float kBias = 127.0F;
  constexpr float kMostTexels = 1e9F;
  const float texels =
      held(footprint_m * inverse_length_ * static_cast<float>(side_), 1.0F, kMostTexels);
  const float scaled = static_cast<float>(std::bit_cast<std::int32_t>(texels)) * kMantissa - kBias;
  return std::min(scaled, static_cast<float>(last_level_));
}

[[gnu::always_inline]] inline void Texture::place(const Spots& spots, Lanes& u,
                                                  Lanes& v) const noexcept {
  for (std::size_t i = 0; i < kLanes; ++i) {
    u[i] = spots.u_m[i] * inverse_length_;
    v[i] = 1.0F - spots.v_m[i] * inverse_length_;  // row 0 is the picture's top
  }
}

[[gnu::always_inline]] inline void Texture::turn(Lanes& u, Lanes& v) const noexcept {
  std::array<int, kLanes> columns{};
  std::array<int, kLanes> rows{};
  int others = 0;  // lanes that see another copy than the first
  for (std::size_t i = 0; i < kLanes; ++i) {
    columns[i] = whole_below(u[i]);
    rows[i] = whole_below(v[i]);
    u[i] -= static_cast<float>(columns[i]);
    v[i] -= static_cast<float>(rows[i]);
  }
  for (std::size_t i = 0; i < kLanes; ++i) {
    others |= (columns[i] ^ columns[0]) | (rows[i] ^ rows[0]);
  }
  const auto turns = [&](std::size_t i) {
    constexpr std::uint64_t kQuarters = 3;
    return subkey(static_cast<std::uint64_t>(static_cast<std::uint32_t>(columns[i])),
                  static_cast<std::uint32_t>(rows[i])) &
           kQuarters;
  };
  const std::uint64_t common = turns(0);
  const auto turn_lane = [&](std::size_t i, std::uint64_t by) __attribute__((always_inline)) {
    const bool quarter = (by & 1U) != 0;
    const float turned_u = quarter ? v[i] : u[i];
    const float turned_v = quarter ? 1.0F - u[i] : v[i];
    const bool half = (by & 2U) != 0;
    u[i] = half ? 1.0F - turned_u : turned_u;
    v[i] = half ? 1.0F - turned_v : turned_v;
  };
  if (others == 0) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      turn_lane(i, common);
    }
    return;
  }
  for (std::size_t i = 0; i < kLanes; ++i) {
    turn_lane(i, turns(i));
  }
}

[[gnu::always_inline]] inline void Texture::find_taps(const Lanes& u, const Lanes& v,
                                                      const Lanes& level,
                                                      Taps& taps) const noexcept {
  const bool clamps = repeat_ == Repeat::kClamp;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const int chosen = static_cast<int>(level[i]);
    const int side = side_ >> chosen;
    const int last = side - 1;
    const auto wrap = [=](int cell) __attribute__((always_inline)) {
      return clamps ? std::min(std::max(cell, 0), last) : cell & last;
    };
    const float x = u[i] * static_cast<float>(side) - 0.5F;
    const float y = v[i] * static_cast<float>(side) - 0.5F;
    const int x0 = whole_below(x);
    const int y0 = whole_below(y);
    taps.weigh(i, x - static_cast<float>(x0), y - static_cast<float>(y0));
    const int first = static_cast<int>(first_[static_cast<std::size_t>(chosen)]);
    const int top = first + wrap(y0) * side;
    const int bottom = first + wrap(y0 + 1) * side;
    taps.index[0][i] = static_cast<std::uint32_t>(top + wrap(x0));
    taps.index[1][i] = static_cast<std::uint32_t>(top + wrap(x0 + 1));
    taps.index[2][i] = static_cast<std::uint32_t>(bottom + wrap(x0));
    taps.index[3][i] = static_cast<std::uint32_t>(bottom + wrap(x0 + 1));
  }
}

void Texture::sample(const Spots& spots, float dither, LaneColours& out) const noexcept {
  with_wide_vectors([&]() __attribute__((always_inline)) {
    Lanes u;
    Lanes v;
    Lanes level;
    Taps taps;
    place(spots, u, v);
    if (repeat_ == Repeat::kShuffle) {
      turn(u, v);
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      level[i] = std::min(level_of(spots.footprint_m[i]) + dither, static_cast<float>(last_level_));
    }
    find_taps(u, v, level, taps);
    for (std::size_t i = 0; i < kLanes; ++i) {
      out[i] = taps.mix(i, [&](std::uint32_t at) __attribute__((always_inline)) {
        return decode(texels_[at]);
      }) * unit_;
    }
  });
}

float Texture::contrast(float footprint_m) const noexcept {
  const float level = level_of(footprint_m);
  const auto fine = static_cast<std::size_t>(level);
  const std::size_t coarse = std::min(fine + 1, contrasts_.size() - 1);
  const float blend = level - static_cast<float>(fine);
  return contrasts_[fine] * (1.0F - blend) + contrasts_[coarse] * blend;
}

}  // namespace geoflow::simulator
