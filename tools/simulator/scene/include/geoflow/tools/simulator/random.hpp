#pragma once

#include <cstdint>
#include <string_view>

/// Random numbers that depend on a seed and on what they are for, and on nothing else: not on the
/// thread, nor on the numbers drawn for something else. The same on every machine.
namespace geoflow::simulator {

/// A bijective scrambling of 64 bits: the finaliser of splitmix64 (Steele, Lea, Flood, "Fast
/// splittable pseudorandom number generators", OOPSLA 2014).
[[nodiscard]] constexpr std::uint64_t scramble(std::uint64_t x) noexcept {
  // NOLINTBEGIN(readability-magic-numbers): the constants of splitmix64
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
  // NOLINTEND(readability-magic-numbers)
}

/// A key for the numbers of one purpose: scrambles `value` into `key`.
[[nodiscard]] constexpr std::uint64_t subkey(std::uint64_t key, std::uint64_t value) noexcept {
  return scramble(key ^ scramble(value));
}
[[nodiscard]] constexpr std::uint64_t subkey(std::uint64_t key, std::string_view purpose) noexcept {
  for (const char c : purpose) {
    key = subkey(key, static_cast<std::uint64_t>(static_cast<unsigned char>(c)));
  }
  return key;
}

/// 64 random bits as a number in [0, 1), from the upper 24 bits.
[[nodiscard]] constexpr float to_unit(std::uint64_t bits) noexcept {
  constexpr unsigned kDropped = 40;
  constexpr float kUnit = 1.0F / 16777216.0F;  // 2^-24
  return static_cast<float>(bits >> kDropped) * kUnit;
}

/// 64 random bits as a number with mean 0 and variance 1 that is normal up to 3.46, where it ends:
/// the sum of its four 16-bit parts.
[[nodiscard]] constexpr float to_normal(std::uint64_t bits) noexcept {
  constexpr std::uint64_t kPart = 0xffff;
  constexpr float kMean = 4.0F * 32767.5F;
  constexpr float kInverseDeviation = 1.0F / 37837.2F;  // sqrt(4 (65536^2 - 1) / 12)
  const std::uint64_t sum =
      (bits & kPart) + ((bits >> 16U) & kPart) + ((bits >> 32U) & kPart) + (bits >> 48U);
  return (static_cast<float>(static_cast<int>(sum)) - kMean) * kInverseDeviation;
}

/// A bijective scrambling of 32 bits, for loops over many pixels at once (C. Wellons, "Prospecting
/// for hash functions", 2018: lowbias32).
[[nodiscard]] constexpr std::uint32_t scramble32(std::uint32_t x) noexcept {
  // NOLINTBEGIN(readability-magic-numbers): the constants of lowbias32
  x = (x ^ (x >> 16U)) * 0x7feb352dU;
  x = (x ^ (x >> 15U)) * 0x846ca68bU;
  return x ^ (x >> 16U);
  // NOLINTEND(readability-magic-numbers)
}

/// 32 random bits as a number with mean 0 and variance 1 that is nearly normal up to 3.45, where it
/// ends: the sum of their four bytes.
[[nodiscard]] constexpr float to_normal32(std::uint32_t bits) noexcept {
  constexpr std::uint32_t kPart = 0xff;
  constexpr float kMean = 4.0F * 127.5F;
  constexpr float kInverseDeviation = 1.0F / 147.8006F;  // sqrt(4 (256^2 - 1) / 12)
  const std::uint32_t sum =
      (bits & kPart) + ((bits >> 8U) & kPart) + ((bits >> 16U) & kPart) + (bits >> 24U);
  return (static_cast<float>(static_cast<int>(sum)) - kMean) * kInverseDeviation;
}

/// A sequence of random numbers for making a scene. A value type; thread-compatible.
class Random {
 public:
  explicit constexpr Random(std::uint64_t key) noexcept : key_{key} {}
  constexpr Random(std::uint64_t seed, std::string_view purpose) noexcept
      : key_{subkey(seed, purpose)} {}

  [[nodiscard]] constexpr std::uint64_t bits() noexcept {
    constexpr std::uint64_t kStride = 0x632be59bd9b4e019ULL;  // odd, thus a bijection of counters
    return scramble(key_ + counter_++ * kStride);
  }
  [[nodiscard]] constexpr float uniform() noexcept { return to_unit(bits()); }
  [[nodiscard]] constexpr float uniform(float low, float high) noexcept {
    return low + (high - low) * uniform();
  }
  [[nodiscard]] constexpr float normal() noexcept { return to_normal(bits()); }
  /// 0 … count - 1; count > 0.
  [[nodiscard]] constexpr int index(int count) noexcept {
    return static_cast<int>(bits() % static_cast<std::uint64_t>(count));
  }
  [[nodiscard]] constexpr bool chance(float probability) noexcept {
    return uniform() < probability;
  }
  /// A generator of its own for one purpose, the same whatever else is drawn.
  [[nodiscard]] constexpr Random fork(std::string_view purpose) const noexcept {
    return Random{subkey(key_, purpose)};
  }

 private:
  std::uint64_t key_;
  std::uint64_t counter_ = 0;
};

}  // namespace geoflow::simulator
