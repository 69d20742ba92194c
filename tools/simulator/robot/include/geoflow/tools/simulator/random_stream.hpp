#pragma once

#include <cstdint>
#include <string_view>

#include "geoflow/hal/geometry.hpp"

namespace geoflow::simulator {

/// Random numbers of one noise source, the same on every machine. Streams of different names (or
/// indices) of one seed are independent, so that turning one knob leaves all other noise as it was.
/// A value type; not shared between threads.
///
/// Source: SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014),
/// started from a hash of seed and name.
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::string_view name) noexcept;

  /// The stream of one sample of this source: what it gives depends on `index` alone, not on what
  /// was drawn before.
  [[nodiscard]] RandomStream at(std::uint64_t index) const noexcept;

  /// In [0, 1), 53 bits.
  double uniform() noexcept;
  double uniform(double low, double high) noexcept;

  /// Mean 0, standard deviation 1 (Box and Muller).
  double normal() noexcept;
  Vector3d normal_vector() noexcept;

 private:
  explicit RandomStream(std::uint64_t start) noexcept : start_{start}, state_{start} {}
  std::uint64_t next() noexcept;

  std::uint64_t start_;
  std::uint64_t state_;
};

}  // namespace geoflow::simulator
