#include "odometry/motion_model.hpp"

#include <chrono>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::slam {
namespace {

using std::chrono::milliseconds;

const Vector6d steady_twist = (Vector6d() << 0.1, -0.2, 0.3, 0.5, 0.1, -0.4).finished();

MotionModel moving_until(HostTime end, Duration step) {
  MotionModel motion;
  for (HostTime t{}; t <= end; t += step) {
    motion.update(t, SE3::exp(to_seconds(t.time_since_epoch()) * steady_twist), Matrix6d::Zero(),
                  true);
  }
  return motion;
}

TEST(MotionModel, PredictsConstantTwistExactly) {
  const MotionModel motion = moving_until(HostTime{milliseconds{990}}, milliseconds{33});
  const SE3 predicted = motion.predict(HostTime{milliseconds{1023}}).T_odom_cam;
  EXPECT_LT((predicted.inverse() * SE3::exp(1.023 * steady_twist)).log().norm(), 1e-9);
}

TEST(MotionModel, ForgetsItsVelocityOverAGapAndSaysSo) {
  const MotionModel motion = moving_until(HostTime{milliseconds{990}}, milliseconds{33});
  const SE3 last = SE3::exp(0.99 * steady_twist);
  const auto near = motion.predict(HostTime{milliseconds{1023}});
  const auto far = motion.predict(HostTime{milliseconds{3990}});
  EXPECT_LT((last.inverse() * far.T_odom_cam).log().norm(), 0.25 * steady_twist.norm());
  EXPECT_LT(far.information(5, 5), 1e-4 * near.information(5, 5));
}

TEST(MotionModel, UntrustedPosesDoNotChangeTheVelocityBeyondFading) {
  MotionModel motion = moving_until(HostTime{milliseconds{990}}, milliseconds{33});
  const Vector6d before = motion.velocity();
  motion.update(HostTime{milliseconds{1023}}, SE3{}, Matrix6d::Zero(), false);
  EXPECT_NEAR(motion.velocity().norm() / before.norm(), 0.72, 0.02);  // exp(-33 ms / 100 ms)
}

}  // namespace
}  // namespace geoflow::slam
