#include "geoflow/tools/simulator/smooth_signal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ranges>
#include <utility>
#include <vector>

#include "geoflow/tools/simulator/random_stream.hpp"

namespace geoflow::simulator {
namespace {

constexpr std::size_t kPieceCount = 6;  // of a quintic

/// The quintic B-spline's six pieces as polynomials of the place u in the spacing, times 120: row i
/// weighs the control i - 2 from the spacing's start, columns are powers of u from 0. Source: de
/// Boor, "A practical guide to splines", uniform knots.
// NOLINTNEXTLINE(readability-magic-numbers)
constexpr std::array<std::array<double, kPieceCount>, kPieceCount> kPieces{
    {{1, -5, 10, -10, 5, -1},
     {26, -50, 20, 20, -20, 5},
     {66, 0, -60, 0, 30, -10},
     {26, 50, 20, -20, -20, 10},
     {1, 5, 10, 10, 5, -5},
     {0, 0, 0, 0, 0, 1}}};
constexpr double kPieceScale = 1.0 / 120;

/// Standard deviation of a spline of independent controls of deviation 1: sqrt(1 + 26^2 + 66^2 +
/// 26^2 + 1) / 120 at a control, where it is greatest.
constexpr double kNoiseDeviation = 0.6297;

Jet polynomial(const std::array<double, kPieceCount>& coefficients, double u) noexcept {
  Jet sum;
  for (const double coefficient : std::views::reverse(coefficients)) {
    sum.accel = sum.accel * u + 2 * sum.rate;
    sum.rate = sum.rate * u + sum.value;
    sum.value = sum.value * u + coefficient;
  }
  return sum;
}

}  // namespace

Jet operator+(const Jet& a, const Jet& b) noexcept {
  return {.value = a.value + b.value, .rate = a.rate + b.rate, .accel = a.accel + b.accel};
}

Jet operator-(const Jet& a, const Jet& b) noexcept {
  return {.value = a.value - b.value, .rate = a.rate - b.rate, .accel = a.accel - b.accel};
}

Jet operator*(const Jet& a, const Jet& b) noexcept {
  return {.value = a.value * b.value,
          .rate = a.rate * b.value + a.value * b.rate,
          .accel = a.accel * b.value + 2 * a.rate * b.rate + a.value * b.accel};
}

Jet operator*(double scale, const Jet& a) noexcept {
  return {.value = scale * a.value, .rate = scale * a.rate, .accel = scale * a.accel};
}

Jet constant(double value) noexcept {
  return {.value = value};
}

Jet sin(const Jet& angle) noexcept {
  const double sine = std::sin(angle.value);
  const double cosine = std::cos(angle.value);
  return {.value = sine,
          .rate = cosine * angle.rate,
          .accel = cosine * angle.accel - sine * angle.rate * angle.rate};
}

Jet cos(const Jet& angle) noexcept {
  const double sine = std::sin(angle.value);
  const double cosine = std::cos(angle.value);
  return {.value = cosine,
          .rate = -sine * angle.rate,
          .accel = -sine * angle.accel - cosine * angle.rate * angle.rate};
}

SmoothSignal::SmoothSignal(double spacing_s, std::vector<double> controls)
    : spacing_s_{spacing_s}, controls_{std::move(controls)} {}

SmoothSignal SmoothSignal::noise(RandomStream random, double spacing_s, double duration_s) {
  const auto count =
      static_cast<std::size_t>(std::ceil(duration_s / spacing_s)) + 2 * kSmoothSignalReach;
  std::vector<double> controls(count);
  std::ranges::generate(controls, [&] { return random.normal() / kNoiseDeviation; });
  return SmoothSignal{spacing_s, std::move(controls)};
}

SmoothSignal SmoothSignal::affine(double scale, double offset) const {
  std::vector<double> controls = controls_;
  for (double& control : controls) {
    control = offset + scale * control;
  }
  return SmoothSignal{spacing_s_, std::move(controls)};
}

SmoothWeights::SmoothWeights(double t_s, double spacing_s) noexcept
    : t_s_{t_s}, spacing_s_{spacing_s} {
  const double start = std::floor(t_s / spacing_s);
  first_ = static_cast<std::int64_t>(start) - 2;
  for (std::size_t piece = 0; piece < kOrder; ++piece) {
    Jet& weight = weights_.at(piece);
    weight = kPieceScale * polynomial(kPieces.at(piece), t_s / spacing_s - start);
    weight.rate /= spacing_s;
    weight.accel /= spacing_s * spacing_s;
  }
}

Jet SmoothSignal::at(double t_s) const noexcept {
  SmoothWeights weights{t_s, spacing_s_};
  return at(weights);
}

Jet SmoothSignal::at(SmoothWeights& weights) const noexcept {
  if (weights.spacing_s_ != spacing_s_) {
    weights = SmoothWeights{weights.t_s_, spacing_s_};
  }
  const auto last = static_cast<std::int64_t>(controls_.size()) - 1;
  Jet sum;
  for (std::size_t piece = 0; piece < kPieceCount; ++piece) {
    const std::int64_t wanted = weights.first_ + static_cast<std::int64_t>(piece);
    const auto index = static_cast<std::size_t>(std::clamp<std::int64_t>(wanted, 0, last));
    sum = sum + controls_[index] * weights.weights_[piece];
  }
  return sum;
}

}  // namespace geoflow::simulator
