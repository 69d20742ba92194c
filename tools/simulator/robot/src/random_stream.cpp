#include "geoflow/tools/simulator/random_stream.hpp"

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

#include "geoflow/hal/geometry.hpp"

namespace geoflow::simulator {
namespace {

// NOLINTBEGIN(readability-magic-numbers): the constants of FNV-1a and SplitMix64

constexpr std::uint64_t kGoldenGamma = 0x9e3779b97f4a7c15U;

std::uint64_t mixed(std::uint64_t z) noexcept {
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31U);
}

std::uint64_t hash_of(std::string_view name) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : name) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  }
  return hash;
}

// NOLINTEND(readability-magic-numbers)

constexpr unsigned kUnusedBits = 11;  // of 64, a double holds 53
constexpr double kUniformStep = 0x1.0p-53;

}  // namespace

RandomStream::RandomStream(std::uint64_t seed, std::string_view name) noexcept
    : RandomStream{mixed(mixed(seed + kGoldenGamma) ^ hash_of(name))} {}

RandomStream RandomStream::at(std::uint64_t index) const noexcept {
  return RandomStream{mixed(start_ ^ mixed(index + kGoldenGamma))};
}

std::uint64_t RandomStream::next() noexcept {
  state_ += kGoldenGamma;
  return mixed(state_);
}

double RandomStream::uniform() noexcept {
  return static_cast<double>(next() >> kUnusedBits) * kUniformStep;
}

double RandomStream::uniform(double low, double high) noexcept {
  return low + (high - low) * uniform();
}

double RandomStream::normal() noexcept {
  const double radius = std::sqrt(-2 * std::log(1 - uniform()));
  return radius * std::cos(2 * std::numbers::pi * uniform());
}

Vector3d RandomStream::normal_vector() noexcept {
  const double x = normal();
  const double y = normal();
  const double z = normal();
  return {x, y, z};
}

}  // namespace geoflow::simulator
