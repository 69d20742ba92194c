#pragma once

#include "geoflow/hal/geometry.hpp"

namespace geoflow::simulator {

/// The sensor's mount as a damped oscillator that a half-sine pulse of acceleration sets ringing.
/// What an accelerometer on it sees besides the body's own motion starts like the pulse and rings
/// out, and both its integrals return to zero: the sensor ends where it began. Closed form.
class Shock {
 public:
  /// A pulse of 1 m/s^2, `pulse_s` long from `start_s` on; the mount rings at `ring_hz` with
  /// `damping` of critical, below 1.
  Shock(double start_s, double pulse_s, double ring_hz, double damping);

  struct Motion {
    double velocity = 0;      ///< of the mount against the body [m/s]
    double acceleration = 0;  ///< [m/s^2]
  };
  [[nodiscard]] Motion at(double t_s) const;

  [[nodiscard]] double start_s() const noexcept { return start_s_; }
  /// After this it has rung out to a thousandth.
  [[nodiscard]] double end_s() const noexcept;
  /// The velocity that the pulse alone would give: the scale of `velocity`.
  [[nodiscard]] double impulse_mps() const noexcept;

 private:
  struct Free {
    double in_phase = 0;
    double quadrature = 0;
  };
  struct State {
    double place = 0;
    double velocity = 0;
  };
  [[nodiscard]] State forced(double since_s) const;
  [[nodiscard]] State free(const Free& free, double since_s) const;
  [[nodiscard]] Free free_from(const State& state) const;

  double start_s_;
  double pulse_s_;
  double omega_;  ///< undamped [rad/s]
  double damping_;
  Free at_start_{};
  Free at_end_{};
};

}  // namespace geoflow::simulator
