#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"

#include "legs/contact.hpp"
#include "legs/foot_motion.hpp"
#include "legs/leg_config.hpp"

namespace geoflow::slam {

/// A velocity of base in base with its covariance.
struct VelocityBelief {
  Vector3d v_base_mps = Vector3d::Zero();
  Matrix3d covariance = Matrix3d::Zero();  ///< [m^2/s^2]
};

/// Base's velocity as the standing feet give it at one instant.
struct StanceVelocity {
  /// Of this instant's noise, which is independent from sample to sample; what is not is
  /// LegNoise::speed_mps.
  VelocityBelief velocity;
  Matrix3d by_turn = Matrix3d::Zero();  ///< d velocity / d w_base [m]
  std::uint32_t legs = 0;  ///< that stand and contribute; with none, velocity says nothing
  std::array<bool, kLegCount> slips{};
  /// Largest rate of change of the distance between two standing feet, in standard deviations:
  /// needs neither gyroscope nor frame, and is 0 while both stand [1].
  double pair_rate = 0;
};

using FootMotions = std::array<std::optional<FootMotion>, kLegCount>;

/// Puts the standing legs' velocities together by their covariances, robustly, and finds legs that
/// slip: each is compared with all others and with a prediction, if there is one (leave one out);
/// the one that disagrees most is set aside and the rest compared anew. A leg that disagrees beyond
/// chi-square's 99.7 % in three samples in a row slips; it is weighted down, not left out. Of two
/// legs without a prediction, neither can be told to slip; pair_rate shows it. Thread-compatible.
class StanceVelocityEstimator {
 public:
  explicit StanceVelocityEstimator(const LegNoise& noise) : noise_{noise} {}

  StanceVelocity update(const FootMotions& motions, const ContactEstimator::Feet& feet,
                        const std::optional<VelocityBelief>& prediction);

 private:
  /// One leg's velocity.
  struct Vote {
    Vector3d v;
    Matrix3d covariance;
    Matrix3d information;
    Vector3d point;  ///< of contact, in base
  };
  using Votes = std::array<std::optional<Vote>, kLegCount>;

  [[nodiscard]] Votes votes(const FootMotions& motions, const ContactEstimator::Feet& feet) const;
  void find_slips(const Votes& votes, const std::optional<VelocityBelief>& prediction);
  [[nodiscard]] static double disagreement(std::size_t leg, const Votes& votes,
                                           const std::optional<VelocityBelief>& prediction);
  [[nodiscard]] static double pair_rate(const Votes& votes);
  static void combine(const Votes& votes, StanceVelocity& result);

  LegNoise noise_;
  std::array<int, kLegCount> disagreements_{};  ///< samples in a row
};

}  // namespace geoflow::slam
