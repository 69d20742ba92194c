#include "geoflow/slam/propagator.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"
#include "tests/support/data.hpp"

#include "odometry/simulated_walk.hpp"

/// Poses at IMU samples on simulated walks, from frames' estimates that are late and noisy, against
/// the exact truth.
namespace geoflow::slam {
namespace {

constexpr double kFrameNoiseM = 2e-3;
constexpr double kFrameNoiseRad = 1e-3;
constexpr double kFrameNoiseMps = 0.05;
constexpr double kFrameDelayS = 0.06;  // exposure to estimate

/// How good poses were.
struct Account {
  int poses = 0;
  double rms_m = 0;
  double rms_rad = 0;
  double nees_translation = 0;  ///< per degree of freedom
  double nees_rotation = 0;
  double frames_rms_m = 0;  ///< the frames' own
  double worst_jump_m = 0;  ///< change of an output against the one before beyond the truth's
};

class Propagating {
 public:
  Propagating(const SimulatedWalk& walk, const Switches& switches)
      : walk_{walk},
        propagator_{Propagator::create(walk.calibration, switches)},
        random_{tests::test_seed(41)} {}

  /// A frame's estimate: the truth with noise of the covariance that it states.
  [[nodiscard]] PoseEstimate frame(double t_s) {
    const auto noise = [&](double sigma) {
      return Vector3d{sigma * normal_(random_), sigma * normal_(random_), sigma * normal_(random_)};
    };
    Vector6d error;
    error << noise(kFrameNoiseRad), noise(kFrameNoiseM);
    PoseEstimate estimate;
    estimate.t = walk_time(t_s);
    const SE3 T_odom_base = walk_.T_world_base(t_s);  // frames: odom is the world here
    estimate.T_odom_base = T_odom_base * SE3::exp(error);
    estimate.v_odom_base = walk_.v_world_base(t_s) + noise(kFrameNoiseMps);
    estimate.covariance.diagonal().head<3>().setConstant(kFrameNoiseRad * kFrameNoiseRad);
    estimate.covariance.diagonal().tail<3>().setConstant(kFrameNoiseM * kFrameNoiseM);
    estimate.status = TrackingStatus::kTracking;
    frames_sum_ += error.tail<3>().squaredNorm();
    ++frames_;
    return estimate;
  }

  /// All samples in the order of their times, each frame after its delay.
  [[nodiscard]] Account run(bool legs, double frames_end_s = kWalkS) {
    std::size_t next_leg = 0;
    double next_frame_s = kFrameS;
    for (const Timed<ImuSample>& sample : walk_.imu) {
      for (; legs && next_leg < walk_.legs.size() && walk_.legs[next_leg].t <= sample.t;
           ++next_leg) {
        propagator_->add(walk_.legs[next_leg]);
      }
      const double now_s = to_seconds(sample.t.time_since_epoch());
      for (; next_frame_s + kFrameDelayS < now_s && next_frame_s < frames_end_s;
           next_frame_s += kFrameS) {
        propagator_->correct(frame(next_frame_s));
      }
      if (const auto pose = propagator_->add(sample)) {
        EXPECT_EQ(pose->t, sample.t);
        judge(*pose, now_s);
      }
    }
    const double n = std::max(1, account_.poses);
    account_.rms_m = std::sqrt(account_.rms_m / n);
    account_.rms_rad = std::sqrt(account_.rms_rad / n);
    account_.nees_rotation /= n;
    account_.nees_translation /= n;
    account_.frames_rms_m = std::sqrt(frames_sum_ / std::max(1, frames_));
    return account_;
  }

  [[nodiscard]] const PoseEstimate& last() const { return last_; }

 private:
  void judge(const PoseEstimate& pose, double t_s) {
    const SE3 T_odom_base_true = walk_.T_world_base(t_s);               // frames: odom is the world
    const SE3 T_error = pose.T_odom_base.inverse() * T_odom_base_true;  // frames: both are base
    const Vector6d error = T_error.log();
    account_.rms_rad += error.head<3>().squaredNorm();
    account_.rms_m += error.tail<3>().squaredNorm();
    const Matrix3d of_rotation = pose.covariance.topLeftCorner<3, 3>();
    const Matrix3d of_translation = pose.covariance.bottomRightCorner<3, 3>();
    account_.nees_rotation += error.head<3>().dot(of_rotation.ldlt().solve(error.head<3>())) / 3;
    account_.nees_translation +=
        error.tail<3>().dot(of_translation.ldlt().solve(error.tail<3>())) / 3;
    const Vector3d off = pose.T_odom_base.translation() - T_odom_base_true.translation();
    if (account_.poses > 0) {
      account_.worst_jump_m = std::max(account_.worst_jump_m, (off - off_).norm());
    }
    off_ = off;
    last_ = pose;
    ++account_.poses;
  }

  const SimulatedWalk& walk_;
  std::unique_ptr<Propagator> propagator_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Account account_;
  double frames_sum_ = 0;
  int frames_ = 0;
  Vector3d off_ = Vector3d::Zero();
  PoseEstimate last_;
};

void record(const std::string& name, const Account& account) {
  testing::Test::RecordProperty(name + "_rms_mm", std::to_string(1e3 * account.rms_m));
  testing::Test::RecordProperty(name + "_rms_mrad", std::to_string(1e3 * account.rms_rad));
  testing::Test::RecordProperty(name + "_nees", std::to_string(account.nees_translation) + " " +
                                                    std::to_string(account.nees_rotation));
  testing::Test::RecordProperty(name + "_jump_mm", std::to_string(1e3 * account.worst_jump_m));
}

TEST(Propagator, GivesAPoseAtEachImuSampleNearlyAsGoodAsTheFramesByLegs) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const SimulatedWalk walk{seed};
    const Account account = Propagating{walk, {}}.run(true);
    record("legs_" + std::to_string(seed), account);
    EXPECT_GT(account.poses, 3500);
    EXPECT_LT(account.rms_m, 1.5 * account.frames_rms_m);
    EXPECT_GT(account.nees_translation, 0.2);
    EXPECT_LT(account.nees_translation, 2);
    EXPECT_GT(account.nees_rotation, 0.2);
    EXPECT_LT(account.nees_rotation, 2);
    // Two frames' errors, 4 standard deviations each.
    EXPECT_LT(account.worst_jump_m, 8 * kFrameNoiseM);
  }
}

TEST(Propagator, IntegratesTheFramesVelocityByTheImuAlone) {
  const SimulatedWalk walk{4};
  const Account account = Propagating{walk, {.legs = false}}.run(true);
  record("imu", account);
  EXPECT_GT(account.poses, 3500);
  // What a velocity's error makes over a frame's delay and time.
  EXPECT_LT(account.rms_m, account.frames_rms_m + 2 * kFrameNoiseMps * (kFrameDelayS + kFrameS));
  EXPECT_GT(account.nees_translation, 0.2);
  EXPECT_LT(account.nees_translation, 2);
  EXPECT_LT(account.nees_rotation, 2);
}

TEST(Propagator, GoesOnByLegsWhenFramesStopAndSaysHowWell) {
  const SimulatedWalk walk{5};
  Propagating propagating{walk, {}};
  constexpr double kLastFrameS = 15;
  const Account account = propagating.run(true, kLastFrameS);
  const PoseEstimate& last = propagating.last();
  EXPECT_EQ(last.status, TrackingStatus::kDegraded);
  const double last_s = to_seconds(last.t.time_since_epoch());
  const SE3 T_odom_base_true = walk.T_world_base(last_s);             // frames: odom is the world
  const SE3 T_error = last.T_odom_base.inverse() * T_odom_base_true;  // frames: both are base
  const Vector6d error = T_error.log();
  EXPECT_LT(error.tail<3>().norm(), 0.1) << "in 5 s of a trot";
  EXPECT_LT(error.dot(last.covariance.ldlt().solve(error)) / 6, 2);
  EXPECT_LT(account.nees_translation, 2);
}

TEST(Propagator, IsTheSameToTheBitAgain) {
  const SimulatedWalk walk{6};
  Propagating first{walk, {}};
  Propagating second{walk, {}};
  EXPECT_EQ(first.run(true).poses, second.run(true).poses);
  EXPECT_TRUE(
      (first.last().T_odom_base.matrix().array() == second.last().T_odom_base.matrix().array())
          .all());
}

TEST(Propagator, SaysNothingWithoutAFrameAndIsNotMadeWithoutAnImusPlace) {
  const SimulatedWalk walk{7};
  const auto propagator = Propagator::create(walk.calibration, {});
  ASSERT_TRUE(propagator);
  for (const Timed<ImuSample>& sample : walk.imu) {
    EXPECT_FALSE(propagator->add(sample));
  }
  PoseEstimate initialising;
  initialising.t = walk.imu.back().t;
  initialising.status = TrackingStatus::kInitialising;
  propagator->correct(initialising);
  Timed<ImuSample> next = walk.imu.back();
  next.t += std::chrono::milliseconds{5};
  EXPECT_FALSE(propagator->add(next));
  EXPECT_FALSE(Propagator::create(walk.calibration, {.imu = false}));
  Calibration without = walk.calibration;
  without.T_cam_imu.reset();
  EXPECT_FALSE(Propagator::create(without, {}));
}

}  // namespace
}  // namespace geoflow::slam
