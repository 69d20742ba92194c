#include "src/shock.hpp"

#include <cmath>
#include <complex>
#include <numbers>

namespace geoflow::simulator {
namespace {

constexpr double kRungOut = 1e-3;

}  // namespace

Shock::Shock(double start_s, double pulse_s, double ring_hz, double damping)
    : start_s_{start_s},
      pulse_s_{pulse_s},
      omega_{2 * std::numbers::pi * ring_hz},
      damping_{damping} {
  const State forced_start = forced(0);
  at_start_ = free_from({.place = -forced_start.place, .velocity = -forced_start.velocity});
  const State forced_end = forced(pulse_s_);
  const State free_end = free(at_start_, pulse_s_);
  at_end_ = free_from({.place = forced_end.place + free_end.place,
                       .velocity = forced_end.velocity + free_end.velocity});
}

Shock::State Shock::forced(double since_s) const {
  const std::complex<double> i{0, 1};
  const double pulse_omega = std::numbers::pi / pulse_s_;
  const std::complex<double> response =
      std::exp(i * pulse_omega * since_s) /
      (omega_ * omega_ - pulse_omega * pulse_omega + 2.0 * i * damping_ * omega_ * pulse_omega);
  return {.place = response.imag(), .velocity = (i * pulse_omega * response).imag()};
}

Shock::Free Shock::free_from(const State& state) const {
  const double ringing = omega_ * std::sqrt(1 - damping_ * damping_);
  return {.in_phase = state.place,
          .quadrature = (state.velocity + damping_ * omega_ * state.place) / ringing};
}

Shock::State Shock::free(const Free& free, double since_s) const {
  const double decay = damping_ * omega_;
  const double ringing = omega_ * std::sqrt(1 - damping_ * damping_);
  const double sine = std::sin(ringing * since_s);
  const double cosine = std::cos(ringing * since_s);
  const double fade = std::exp(-decay * since_s);
  const double place = free.in_phase * cosine + free.quadrature * sine;
  const double turned = -free.in_phase * sine + free.quadrature * cosine;
  return {.place = fade * place, .velocity = fade * (ringing * turned - decay * place)};
}

Shock::Motion Shock::at(double t_s) const {
  const double since_s = t_s - start_s_;
  if (since_s < 0) {
    return {};
  }
  State state;
  double pulse = 0;
  if (since_s < pulse_s_) {
    const State forced_part = forced(since_s);
    const State free_part = free(at_start_, since_s);
    state = {.place = forced_part.place + free_part.place,
             .velocity = forced_part.velocity + free_part.velocity};
    pulse = std::sin(std::numbers::pi * since_s / pulse_s_);
  } else {
    state = free(at_end_, since_s - pulse_s_);
  }
  return {.velocity = state.velocity,
          .acceleration =
              pulse - 2 * damping_ * omega_ * state.velocity - omega_ * omega_ * state.place};
}

double Shock::end_s() const noexcept {
  return start_s_ + pulse_s_ - std::log(kRungOut) / (damping_ * omega_);
}

double Shock::impulse_mps() const noexcept {
  return 2 / std::numbers::pi * pulse_s_;
}

}  // namespace geoflow::simulator
