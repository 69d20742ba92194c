#include "geoflow/tools/simulator/imu_simulator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/support_forces.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

#include "src/shock.hpp"
#include "walk_fixture.hpp"

namespace geoflow::simulator {
namespace {

using tests::walk_for;

SE3 mounted_imu() {
  return go2_T_base_cam() * d435i_T_cam_imu();
}

struct Navigation {
  Eigen::Quaterniond q_world_imu;
  Vector3d v_world = Vector3d::Zero();
  Vector3d p_world = Vector3d::Zero();
};

/// One step of strapdown integration over two sampling periods through three readings: rotation by
/// the Magnus expansion to fourth order, velocity and position by Simpson's rule.
void integrate(const ImuSample& a, const ImuSample& b, const ImuSample& c, double period_s,
               Navigation& state) {
  const double h = 2 * period_s;
  const auto rotation_until = [&](double s) {
    // Of the quadratic through the three rates: its integral from 0 to s, and the commutator term.
    const Vector3d w0 = a.gyro_radps;
    const Vector3d slope = (-3 * a.gyro_radps + 4 * b.gyro_radps - c.gyro_radps) / h;
    const Vector3d curve = (2 * a.gyro_radps - 4 * b.gyro_radps + 2 * c.gyro_radps) / (h * h);
    const Vector3d sum = w0 * s + slope * s * s / 2 + curve * s * s * s / 3;
    const Vector3d coning =
        w0.cross(slope) * (s * s * s / 12) + w0.cross(curve) * (s * s * s * s / 12);
    return so3::exp(sum + coning);
  };
  const Vector3d gravity = -kGravityMps2 * Vector3d::UnitZ();
  const Eigen::Quaterniond q_middle = state.q_world_imu * rotation_until(period_s);
  const Eigen::Quaterniond q_end = state.q_world_imu * rotation_until(h);
  const Vector3d at0 = state.q_world_imu * a.accel_mps2 + gravity;
  const Vector3d at1 = q_middle * b.accel_mps2 + gravity;
  const Vector3d at2 = q_end * c.accel_mps2 + gravity;
  state.p_world += h * state.v_world + h * h / 6 * (at0 + 2 * at1);
  state.v_world += h / 6 * (at0 + 4 * at1 + at2);
  state.q_world_imu = q_end.normalized();
}

/// The readings with `factor` - 1 more between each two, of the polynomial through the eight about
/// them.
std::vector<ImuSample> interpolated(const std::vector<ImuReading>& readings, std::size_t factor) {
  constexpr std::size_t kPoints = 8;
  std::vector<ImuSample> fine;
  fine.reserve(readings.size() * factor);
  for (std::size_t i = 0; i + 1 < readings.size(); ++i) {
    const std::size_t first =
        std::clamp(i + 1, kPoints / 2, readings.size() - kPoints / 2) - kPoints / 2;
    for (std::size_t k = 0; k < factor; ++k) {
      const double place =
          static_cast<double>(i - first) + static_cast<double>(k) / static_cast<double>(factor);
      ImuSample sample;
      for (std::size_t j = 0; j < kPoints; ++j) {
        double weight = 1;  // Lagrange's
        for (std::size_t other = 0; other < kPoints; ++other) {
          if (other != j) {
            weight *= (place - static_cast<double>(other)) /
                      (static_cast<double>(j) - static_cast<double>(other));
          }
        }
        sample.gyro_radps += weight * readings[first + j].sample.gyro_radps;
        sample.accel_mps2 += weight * readings[first + j].sample.accel_mps2;
      }
      fine.push_back(sample);
    }
  }
  fine.push_back(readings.back().sample);
  return fine;
}

/// How far from the true trajectory a minute's integration ends.
struct Drift {
  double position_m = 0;
  double angle_deg = 0;
};

/// Of the exact readings of a walk at a rate, integrated in steps of 2 / (`factor` * `rate_hz`).
Drift drift_of(const Walk& walk, double rate_hz, std::size_t factor) {
  const SE3 T_base_imu = mounted_imu();
  ImuOptions options = exact_imu();
  options.rate_hz = rate_hz;
  const std::vector<ImuSample> samples =
      interpolated(ImuSimulator{walk, T_base_imu, 1, options}.readings(), factor);
  const BodyState start = walk.body().at(0);
  const SE3 T_world_imu = start.T_world_base * T_base_imu;
  const Vector3d arm = start.T_world_base.rotation() * start.w_base.cross(T_base_imu.translation());
  Navigation state{.q_world_imu = T_world_imu.rotation(),
                   .v_world = start.v_world_base + arm,
                   .p_world = T_world_imu.translation()};
  const double period_s = 1 / (rate_hz * static_cast<double>(factor));
  std::size_t i = 0;
  for (; i + 2 < samples.size(); i += 2) {
    integrate(samples[i], samples[i + 1], samples[i + 2], period_s, state);
  }
  const SE3 T_world_imu1 =
      walk.body().at(static_cast<double>(i) * period_s).T_world_base * T_base_imu;
  return {.position_m = (state.p_world - T_world_imu1.translation()).norm(),
          .angle_deg =
              state.q_world_imu.angularDistance(T_world_imu1.rotation()) * 180 / std::numbers::pi};
}

// Readings at 200 Hz, a D435i's rate, hold the whole motion: each is exact, and what lies between
// two follows from those about them (tenths of a millimetre and 1e-5 degrees after a minute). What
// is too coarse for a gait is Simpson's rule over the 10 ms of three readings: it leaves 3 cm, of a
// pronounced trot 16 cm, and a sixteenth of that over 5 ms. Rotation is well within the bound even
// so.
TEST(ImuSimulator, IntegratingTheExactReadingsGivesTheTrajectory) {
  constexpr double kPosition_m = 0.01;
  constexpr double kAngle_deg = 0.01;
  for (const bool pronounced : {false, true}) {
    const Walk walk = walk_for(60, pronounced ? with_pronounced_trot({}) : WalkOptions{});
    const std::string kind = pronounced ? "pronounced" : "usual";
    const auto expect_small = [&](double rate_hz, std::size_t factor) {
      const Drift drift = drift_of(walk, rate_hz, factor);
      const std::string name = kind + "_" + std::to_string(std::lround(rate_hz)) + "_hz";
      RecordProperty(name + "_position_m", std::to_string(drift.position_m));
      RecordProperty(name + "_angle_deg", std::to_string(drift.angle_deg));
      EXPECT_LT(drift.position_m, kPosition_m) << name;
      EXPECT_LT(drift.angle_deg, kAngle_deg) << name;
    };
    expect_small(1000, 1);
    expect_small(200, 5);
    const Drift coarse = drift_of(walk, 200, 1);
    EXPECT_LT(coarse.angle_deg, kAngle_deg);
    // It is the step that errs: of fourth order, so half of it leaves a sixteenth.
    EXPECT_NEAR(coarse.position_m / drift_of(walk, 400, 1).position_m, 16, 1);
  }
}

TEST(Shock, RingsOutToRestAsItsEquationSays) {
  const Shock shock{0.1, 0.005, 50, 0.12};
  constexpr double kStep = 1e-5;
  constexpr double kOmega = 2 * std::numbers::pi * 50;
  double velocity = 0;
  double place = 0;
  double hardest = 0;
  for (double t_s = 0.1; t_s < 0.8; t_s += kStep) {
    // Midpoint integration of the acceleration, beside the closed form.
    const Shock::Motion middle = shock.at(t_s + kStep / 2);
    const double pulse =
        t_s + kStep / 2 < 0.105 ? std::sin(std::numbers::pi * (t_s + kStep / 2 - 0.1) / 0.005) : 0;
    const double place_middle = place + kStep / 2 * velocity;
    EXPECT_NEAR(middle.acceleration,
                pulse - 2 * 0.12 * kOmega * middle.velocity - kOmega * kOmega * place_middle, 2e-3);
    place += kStep * (velocity + kStep / 2 * middle.acceleration);
    velocity += kStep * middle.acceleration;
    EXPECT_NEAR(shock.at(t_s + kStep).velocity, velocity, 1e-7);
    hardest = std::max(hardest, std::abs(middle.acceleration));
  }
  EXPECT_NEAR(velocity, 0, 1e-6);
  EXPECT_NEAR(place, 0, 1e-6);
  EXPECT_GT(hardest, 0.7);
  EXPECT_LT(hardest, 1.3);
}

/// The strength of `values` at `hz`: amplitude of the sine there.
double line(const std::vector<double>& values, double rate_hz, double hz) {
  double in_phase = 0;
  double quadrature = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double angle = 2 * std::numbers::pi * hz * static_cast<double>(i) / rate_hz;
    in_phase += values[i] * std::cos(angle);
    quadrature += values[i] * std::sin(angle);
  }
  return 2 * std::hypot(in_phase, quadrature) / static_cast<double>(values.size());
}

TEST(ImuSimulator, HardShocksReachFortyInAllDirectionsAndRingAsTheMountDoes) {
  const Walk walk = walk_for(60);
  ImuOptions options = with_hard_shocks(exact_imu());
  options.rate_hz = 1000;
  const std::vector<ImuReading> shaken = ImuSimulator{walk, SE3{}, 1, options}.readings();
  const std::vector<ImuReading> smooth = [&] {
    ImuOptions quiet = exact_imu();
    quiet.rate_hz = options.rate_hz;
    return ImuSimulator{walk, SE3{}, 1, quiet}.readings();
  }();
  Vector3d highest = Vector3d::Zero();
  Vector3d lowest = Vector3d::Zero();
  std::vector<double> ringing;
  for (std::size_t i = 0; i < shaken.size(); ++i) {
    const Vector3d shock = shaken[i].sample.accel_mps2 - smooth[i].sample.accel_mps2;
    highest = highest.cwiseMax(shock);
    lowest = lowest.cwiseMin(shock);
    ringing.push_back(shock.x());
  }
  // In every direction, and not beyond what superposes.
  EXPECT_GT(highest.minCoeff(), 25);
  EXPECT_LT(lowest.maxCoeff(), -25);
  EXPECT_LT(highest.maxCoeff(), 60);
  EXPECT_GT(lowest.minCoeff(), -60);
  const auto band = [&](double low_hz, double high_hz) {
    double energy = 0;
    for (double hz = low_hz; hz < high_hz; hz += 0.25) {
      energy += std::pow(line(ringing, options.rate_hz, hz), 2);
    }
    return energy / (high_hz - low_hz);
  };
  EXPECT_GT(band(30, 80), 4 * band(5, 20));
  EXPECT_GT(band(30, 80), 4 * band(150, 200));
}

TEST(ImuSimulator, SaturatesAtTheSensorsRange) {
  const Walk walk = walk_for(30, with_pronounced_trot({}));
  ImuOptions options = with_hard_shocks({});
  options.shock_mps2 = 80;
  double highest = 0;
  for (const ImuReading& reading : ImuSimulator{walk, mounted_imu(), 1, options}.readings()) {
    highest = std::max(highest, reading.sample.accel_mps2.cwiseAbs().maxCoeff());
  }
  EXPECT_NEAR(highest, 39.2266, 0.01);
}

/// What a signal's spread is.
double deviation(const std::vector<double>& values) {
  double sum = 0;
  double squares = 0;
  for (const double value : values) {
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(values.size());
  return std::sqrt(std::max(squares / count - sum * sum / (count * count), 0.0));
}

TEST(ImuSimulator, AWalkLooksLikeARealGo1s) {
  const std::array<Vector2d, 2> straight{Vector2d{0, 0}, Vector2d{40, 0}};
  WalkOptions options;
  options.duration_s = 40;
  options.gait_hz = 1.65;
  options.speed_mps = 0.3;
  const auto walk = plan_walk(straight, options);
  ASSERT_TRUE(walk.has_value());
  std::array<std::vector<double>, 6> signals;
  for (const ImuReading& reading : ImuSimulator{*walk, SE3{}, 1, {}}.readings()) {
    if (reading.t_s > 6) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto row = static_cast<Eigen::Index>(axis);
        signals.at(axis).push_back(reading.sample.accel_mps2[row]);
        signals.at(axis + 3).push_back(reading.sample.gyro_radps[row]);
      }
    }
  }
  // Standard deviations of a real Go1's body IMU over three parts of a recording (m/s^2, rad/s),
  // the least less a third and the greatest and a third more: another robot at another pace.
  constexpr std::array<double, 6> kLeast{1.21, 0.99, 2.17, 0.24, 0.187, 0.186};
  constexpr std::array<double, 6> kGreatest{1.36, 1.44, 2.43, 0.31, 0.21, 0.25};
  for (std::size_t i = 0; i < signals.size(); ++i) {
    const double spread = deviation(signals.at(i));
    RecordProperty("deviation_" + std::to_string(i), std::to_string(spread));
    EXPECT_GT(spread, kLeast.at(i) * 2 / 3) << i;
    EXPECT_LT(spread, kGreatest.at(i) * 4 / 3) << i;
  }
}

TEST(ImuSimulator, NoiseAndRandomWalkHaveTheirDensities) {
  WalkOptions standing;
  standing.speed_mps = 0;
  standing.wander = 0;
  const Walk walk = walk_for(100, standing);
  ImuOptions options = exact_imu();
  options.noise_scale = 1;
  const std::vector<ImuReading> readings = ImuSimulator{walk, SE3{}, 2, options}.readings();
  std::vector<double> accel;
  std::vector<double> steps;
  for (std::size_t i = 1; i < readings.size(); ++i) {
    accel.push_back(readings[i].sample.accel_mps2.x() - readings[i].accel_bias_mps2.x());
    steps.push_back(readings[i].gyro_bias_radps.y() - readings[i - 1].gyro_bias_radps.y());
  }
  const double white = options.noise.accel_noise_density * std::sqrt(200);
  EXPECT_NEAR(deviation(accel) / white, 1, 0.03);
  EXPECT_NEAR(deviation(steps) / (options.noise.gyro_random_walk / std::sqrt(200)), 1, 0.03);
}

TEST(ImuSimulator, AxesErrInScaleAndDirectionByAsMuchAsTheKnobsSay) {
  constexpr std::uint64_t kSeeds = 40;
  constexpr double kScale = 0.01;
  constexpr double kMisalignmentRad = 0.02;
  const Walk walk = walk_for(4);
  const std::vector<ImuReading> exact =
      ImuSimulator{walk, mounted_imu(), 1, exact_imu()}.readings();
  ImuOptions options = exact_imu();
  options.scale_error = kScale;
  options.misalignment_rad = kMisalignmentRad;
  std::vector<double> on_axis;
  std::vector<double> beside;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const std::vector<ImuReading> read =
        ImuSimulator{walk, mounted_imu(), seed, options}.readings();
    for (const auto measured : {&ImuSample::accel_mps2, &ImuSample::gyro_radps}) {
      // The matrix that makes what is read of what is true, by least squares.
      Matrix3d read_by_true = Matrix3d::Zero();
      Matrix3d true_by_true = Matrix3d::Zero();
      for (std::size_t i = 0; i < exact.size(); ++i) {
        const Vector3d& truth = exact[i].sample.*measured;
        read_by_true += read[i].sample.*measured * truth.transpose();
        true_by_true += truth * truth.transpose();
      }
      const Matrix3d errors = read_by_true * true_by_true.inverse() - Matrix3d::Identity();
      for (Eigen::Index row = 0; row < 3; ++row) {
        for (Eigen::Index column = 0; column < 3; ++column) {
          (row == column ? on_axis : beside).push_back(errors(row, column));
        }
      }
    }
  }
  EXPECT_NEAR(deviation(on_axis) / kScale, 1, 0.15);
  EXPECT_NEAR(deviation(beside) / kMisalignmentRad, 1, 0.1);
}

TEST(ImuSimulator, FaultsDistortInBurstsThatTheTruthNames) {
  const Walk walk = walk_for(60);
  ImuOptions options;
  options.fault_interval_s = 8;
  const std::vector<ImuReading> faulty = ImuSimulator{walk, mounted_imu(), 3, options}.readings();
  const std::vector<ImuReading> sound = ImuSimulator{walk, mounted_imu(), 3, {}}.readings();
  std::size_t in_bursts = 0;
  double hardest = 0;
  for (std::size_t i = 0; i < faulty.size(); ++i) {
    if (!faulty[i].faulty) {
      EXPECT_EQ(faulty[i].sample.accel_mps2, sound[i].sample.accel_mps2);
      EXPECT_EQ(faulty[i].sample.gyro_radps, sound[i].sample.gyro_radps);
      continue;
    }
    ++in_bursts;
    hardest = std::max(hardest, (faulty[i].sample.accel_mps2 - sound[i].sample.accel_mps2).norm());
  }
  EXPECT_GT(in_bursts, faulty.size() / 30);
  EXPECT_LT(in_bursts, faulty.size() / 2);
  EXPECT_GT(hardest, 25);
}

TEST(ImuSimulator, AtRestTheCameraFeelsGravityAlongItsYAxis) {
  WalkOptions standing;
  standing.speed_mps = 0;
  standing.wander = 0;
  const Walk walk = walk_for(3, standing);
  const Vector3d felt = ideal_imu(walk.body().at(1), mounted_imu()).accel_mps2;
  EXPECT_NEAR(felt.norm(), kGravityMps2, 1e-9);
  EXPECT_LT(felt.y(), -9.7);  // optical axes: y is down
  EXPECT_NEAR(felt.z(), -kGravityMps2 * std::sin(5 * std::numbers::pi / 180), 0.02);
}

TEST(ImuSimulator, ItsKnobsHoldTheirDefaults) {
  for (const Knob<ImuOptions>& knob : imu_knobs()) {
    const KnobInfo info = describe(knob);
    EXPECT_TRUE(info.name.starts_with("imu."));
    EXPECT_LE(info.minimum, info.fallback) << info.name;
    EXPECT_GE(info.maximum, info.fallback) << info.name;
  }
}

}  // namespace
}  // namespace geoflow::simulator
