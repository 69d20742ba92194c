#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/random_stream.hpp"

namespace geoflow::simulator {

/// A quantity with its first and second derivative by time; arithmetic follows the rules of
/// differentiation exactly.
struct Jet {
  double value = 0;
  double rate = 0;   ///< [1/s]
  double accel = 0;  ///< [1/s^2]

  friend Jet operator+(const Jet& a, const Jet& b) noexcept;
  friend Jet operator-(const Jet& a, const Jet& b) noexcept;
  friend Jet operator*(const Jet& a, const Jet& b) noexcept;
  friend Jet operator*(double scale, const Jet& a) noexcept;
};
[[nodiscard]] Jet constant(double value) noexcept;
[[nodiscard]] Jet sin(const Jet& angle) noexcept;
[[nodiscard]] Jet cos(const Jet& angle) noexcept;

/// The weights of a SmoothSignal's controls at one time: the same for all signals of one spacing.
class SmoothWeights {
 public:
  SmoothWeights(double t_s, double spacing_s) noexcept;

 private:
  friend class SmoothSignal;
  static constexpr std::size_t kOrder = 6;  // a quintic

  double t_s_;
  double spacing_s_;
  std::int64_t first_ =
      0;  ///< the control that the first weight is for; may lie outside the controls
  std::array<Jet, kOrder> weights_{};
};

/// A function of time with four continuous derivatives: the uniform quintic B-spline of control
/// values that stand `spacing_s` apart, the first at time 0. It stays within the controls' range,
/// and a control acts on less than three spacings to both sides. Outside the controls the last one
/// holds. Const calls are thread-safe.
class SmoothSignal {
 public:
  /// Constant.
  explicit SmoothSignal(double value = 0) : SmoothSignal{1, {value}} {}
  /// `controls` is not empty, `spacing_s` is positive.
  SmoothSignal(double spacing_s, std::vector<double> controls);

  /// Random, with mean 0 and standard deviation 1, until `duration_s`.
  [[nodiscard]] static SmoothSignal noise(RandomStream random, double spacing_s, double duration_s);

  /// offset + scale * this.
  [[nodiscard]] SmoothSignal affine(double scale, double offset) const;

  [[nodiscard]] Jet at(double t_s) const noexcept;
  /// The same for a time whose weights are known; makes `weights` those of this signal's spacing.
  [[nodiscard]] Jet at(SmoothWeights& weights) const noexcept;

 private:
  double spacing_s_;
  std::vector<double> controls_;
};

/// How many spacings to each side a control of SmoothSignal acts.
inline constexpr std::size_t kSmoothSignalReach = 3;

}  // namespace geoflow::simulator
