#include <cmath>
#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/mapping.hpp"

#include "inertial/up_direction.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/map_builder.hpp"
#include "slam/vision/textured_wall.hpp"

/// Keyframes that see nothing in common, tied by registrations alone, and feel which way is up.
namespace geoflow::slam {
namespace {

constexpr int kKeyframes = 10;
constexpr double kStepM = 0.1;

/// The angle between two directions [rad].
double angle(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

class Upright : public testing::Test {
 protected:
  /// Adds a keyframe where the registration to the one before says that it is.
  KeyframeId add(const SE3& T_before_this, const std::optional<UpDirection>& up) {
    Keyframe keyframe;
    if (newest_) {
      const SE3& T_odom_before = map_.keyframe(*newest_).T_odom_cam;
      keyframe.T_odom_cam = T_odom_before * T_before_this;  // frames: this camera is the keyframe's
    }
    keyframe.up = up;
    const KeyframeId id = map_.add_keyframe(keyframe);
    if (newest_) {
      map_.add_edge({.from = *newest_,
                     .to = id,
                     .T_from_to = T_before_this,
                     .information = 1e5 * Matrix6d::Identity()});
    }
    newest_ = id;
    return id;
  }
  void adjust() {
    const MappingResult result = optimise(builder_.task(map_, *newest_));
    ASSERT_NE(result.solution, nullptr);
    (void)builder_.apply(map_, *result.solution);
  }
  /// Of the newest keyframe, which is truly upright where its heading is all that it has turned by.
  [[nodiscard]] double tilt() const {
    return angle(map_.keyframe(*newest_).T_odom_cam.rotation() * Vector3d::UnitZ(),
                 Vector3d::UnitZ());
  }

  Map map_;
  std::optional<KeyframeId> newest_;
  MapBuilder builder_{
      {}, {}, {.camera = wall_camera(), .source = "the test", .serial = {}}, nullptr};
};

TEST_F(Upright, WhatRegistrationsTiltGravityHolds) {
  constexpr double kTiltRad = 0.003;  // with each step, as a depth camera's bias may do it
  const SE3 T_before_this{so3::exp(Vector3d{kTiltRad, 0, 0}), Vector3d{kStepM, 0, 0}};
  const UpDirection up{.variance = 1e-8};
  add(SE3{}, up);
  for (int i = 1; i < kKeyframes; ++i) {
    add(T_before_this, up);
  }
  EXPECT_NEAR(tilt(), kTiltRad * (kKeyframes - 1), 1e-6);
  adjust();
  EXPECT_LT(tilt(), 0.1 * kTiltRad * (kKeyframes - 1));
}

TEST_F(Upright, WithoutAnImuRegistrationsAreBelieved) {
  const SE3 T_before_this{so3::exp(Vector3d{0.003, 0, 0}), Vector3d{kStepM, 0, 0}};
  for (int i = 0; i < kKeyframes; ++i) {
    add(T_before_this, std::nullopt);
  }
  const double before = tilt();
  adjust();
  EXPECT_NEAR(tilt(), before, 1e-6);
}

/// An accelerometer's bias looks like a tilt, the same in the sensor's frame wherever it heads.
class BiasedUpright : public Upright {
 protected:
  static constexpr double kBiasMps2 = 0.1;
  static constexpr double kGravityMps2 = 9.81;

  static UpDirection felt(double assumed_mps2, double sigma_mps2) {
    UpDirection up{.variance = 1e-8};
    up.per_bias(0, 0) = -1 / kGravityMps2;
    up.bias = Vector3d{assumed_mps2, 0, 0};
    up.bias_covariance(0, 0) = sigma_mps2 * sigma_mps2;
    up.up = Vector3d{(kBiasMps2 - assumed_mps2) / kGravityMps2, 0, 1}.normalized();
    return up;
  }
  /// Half the way in one heading, and the other half across it.
  void walk_and_turn(const UpDirection& before, const UpDirection& after) {
    for (int i = 0; i < kKeyframes; ++i) {
      const double turn = i == kKeyframes / 2 ? M_PI / 2 : 0;
      add(SE3{so3::exp(Vector3d{0, 0, turn}), Vector3d{kStepM, 0, 0}},
          i < kKeyframes / 2 ? before : after);
    }
  }
};

TEST_F(BiasedUpright, ABiasThatIsNotKnownTiltsNothing) {
  walk_and_turn(felt(0, kBiasMps2), felt(0, kBiasMps2));
  adjust();
  // Registrations know it to 3 mrad a step, gravity to 14 in all.
  EXPECT_LT(tilt(), 0.25 * kBiasMps2 / kGravityMps2);
}

TEST_F(BiasedUpright, ABiasThatTheTurnTellsIsTakenOutOfWhatWasFeltBefore) {
  walk_and_turn(felt(0, kBiasMps2), felt(kBiasMps2, 1e-3));
  adjust();
  EXPECT_LT(tilt(), 0.02 * kBiasMps2 / kGravityMps2);
}

}  // namespace
}  // namespace geoflow::slam
