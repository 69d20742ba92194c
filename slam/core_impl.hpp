#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/stage.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"
#include "map/followed_frames.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/map_builder.hpp"
#include "map/map_correction.hpp"
#include "map/mapping_problem.hpp"
#include "odometry/dead_reckoner.hpp"
#include "odometry/depth_scale.hpp"
#include "odometry/motion_model.hpp"
#include "odometry/pose_optimiser.hpp"
#include "odometry/tracker.hpp"
#include "optimisation/matrix6.hpp"
#include "place/loop_closer.hpp"
#include "storage/stored_map.hpp"

namespace geoflow::slam {

/// The estimator behind Core: a packet in, a pose out, and a map that grows. Thread-bound.
class Core::Impl {
 public:
  Impl(const Calibration& calibration, const Config& config, std::shared_ptr<const CellGrid> grid,
       StageObserver* observer, const StoredMap* saved)
      : config_{config},
        calibration_{calibration},
        T_base_cam_{calibration.T_base_cam.value_or(SE3{})},
        reckoner_{config.switches, calibration},
        tracker_{config, gicp_, calibration, std::move(grid), observer},
        builder_{config, gicp_, calibration, observer},
        loop_closer_{config, gicp_, calibration},
        map_{saved == nullptr ? Map{} : Map{saved->contents}},
        observer_{observer} {}

  PoseEstimate process(const SyncedPacket& packet) {
    extend_map();
    const std::optional<ReckonedMotion> motion = reckoner_.add(packet);
    up_ = motion ? motion->up : std::nullopt;
    since_keyframe_ =
        motion && since_keyframe_ ? std::optional{*since_keyframe_ * *motion} : std::nullopt;
    if (frames_.empty()) {
      motion_.update(packet.t, T_base_cam_, Matrix6d::Zero(), true);
    }
    const bool shows = fits_camera(packet.color);
    if (shows) {
      tracker_.begin_frame(packet);
    }
    if (!begun_ && shows && shows_depth(tracker_.current())) {
      return start(packet, motion);
    }
    return begun_ && shows ? follow(packet, motion) : carry(packet, motion);
  }

  void extend_map() {
    if (const auto covariance = std::exchange(keyframe_due_, std::nullopt)) {
      insert_keyframe(*covariance);
      frames_.newest_is(reference_);
    }
  }

  std::optional<MappingTask> take_mapping_task();
  std::optional<MappingTask> take_global_task();
  void apply(const MappingResult& result);

  [[nodiscard]] Readout readout() const {
    return {.mean_s = tracker_.readout().seconds(), .sigma_s = tracker_.readout().sigma()};
  }

  [[nodiscard]] Trajectory final_trajectory() const {
    return frames_.trajectory(map_, T_base_cam_);
  }

  [[nodiscard]] std::shared_ptr<const StoredMap> snapshot() const {
    return std::make_shared<const StoredMap>(slam::snapshot(map_, calibration_));
  }

 private:
  /// A frame that follows from the one before but has not been found in the map for so long begins
  /// a new part of it, tied to the old one by nothing but what was dead-reckoned in between.
  static constexpr int kLostFrames = 15;

  /// Depth of a saved map is read where the camera comes near it: with each keyframe some.
  static constexpr double kNearM = 4;
  static constexpr std::size_t kCloudsAtOnce = 8;

  /// A map begins with a frame whose depth fills at least this share of the image: what shows less,
  /// as a covered lens does, would hold no frame after it.
  static constexpr double kLeastDepth = 0.05;

  /// What was solved before the whole map moved is where the map was then. What was measured is
  /// good all the same.
  void take_over(const MappingSolution& solution, bool current);
  /// Ties the part of a new keyframe to the one in which it has found its place.
  void join(const RelativeEdge& tie);
  /// The map has moved, and the robot in it; where it is in odom stays as it is.
  void move_in_map(const SE3& T_map1_map0);
  /// Moves what depends on the newest keyframes.
  void move(const SE3& T_odom1_odom0);

  [[nodiscard]] bool fits_camera(const FrameRef& image) const {
    return image && image.shape().width == calibration_.camera.width &&
           image.shape().height == calibration_.camera.height;
  }

  [[nodiscard]] static bool shows_depth(const Frame& frame) {
    return frame.cloud && static_cast<double>(frame.cloud->size()) >
                              kLeastDepth * static_cast<double>(frame.cloud->grid().size());
  }

  /// Begins the map: where legs have carried the robot from the first packet on, or, if they have
  /// not, at the origin.
  PoseEstimate start(const SyncedPacket& packet, const std::optional<ReckonedMotion>& motion) {
    const PosePrior prior = motion_.predict(packet.t, motion);
    const SE3 T_odom_cam = carried_ ? prior.T_odom_cam : T_base_cam_;
    const Matrix6d covariance = carried_ ? inverse(prior.information) : Matrix6d::Zero();
    tracker_.current().T_odom_cam = T_odom_cam;
    motion_.update(packet.t, T_odom_cam, covariance, true);
    scale_.follow(T_odom_cam.translation(), tracker_.current().cloud.get());
    insert_keyframe(covariance);
    begun_ = true;
    frames_.add(packet.t, reference_, SE3{});
    PoseEstimate estimate = estimate_at(packet, T_odom_cam);
    estimate.status = fixed_status();
    estimate.source = PoseSource::kNone;
    estimate.covariance = stated(covariance, T_odom_cam);
    return estimate;
  }

  /// Of a packet that cannot be looked at, or shows nothing yet that a map could begin with: legs
  /// and IMU carry the pose on.
  PoseEstimate carry(const SyncedPacket& packet, const std::optional<ReckonedMotion>& motion) {
    const PosePrior prior = motion_.predict(packet.t, motion);
    const SE3 T_odom_cam = prior.T_odom_cam;
    carried_ = carried_ || (motion && motion->legs);
    drift_ = inverse(prior.information);
    T_odom_cam_ = T_odom_cam;
    motion_.update(packet.t, T_odom_cam, drift_, motion && motion->legs);
    PoseEstimate estimate = estimate_at(packet, T_odom_cam);
    estimate.source = source_of(motion);
    estimate.quality = 0;
    if (begun_) {
      ++frames_lost_;
      frames_.add(packet.t, reference_,
                  map_.keyframe(reference_).T_odom_cam.inverse() * T_odom_cam);
      estimate.covariance = stated(covariance_in_odom(T_odom_cam), T_odom_cam);
    } else {
      frames_.add(packet.t, std::nullopt, T_odom_cam);
      estimate.covariance = stated(drift_, T_odom_cam);
    }
    estimate.status = begun_ || carried_ ? reckoned_status(motion) : TrackingStatus::kInitialising;
    return estimate;
  }

  PoseEstimate follow(const SyncedPacket& packet, const std::optional<ReckonedMotion>& motion) {
    const std::optional<PosePrior> reckoned = since_keyframe();
    // From the keyframe on, what has pulled at the frames before is not carried along.
    const bool by_keyframe = reckoned && frames_lost_ == 0;
    const TrackingResult result =
        tracker_.track(map_, {.prior = by_keyframe ? *reckoned : motion_.predict(packet.t, motion),
                              .by = source_of(motion),
                              .since_keyframe = reckoned});
    const SE3 T_odom_cam = tracker_.current().T_odom_cam;
    const bool fixed = result.anchored && (result.visual_fix || result.depth_fix);
    frames_lost_ = fixed ? 0 : frames_lost_ + 1;
    const bool begin_anew = frames_lost_ > kLostFrames && result.sure;
    if (begin_anew) {
      ++reset_counter_;
      frames_lost_ = 0;
      tracker_.current().anchored = true;
    }
    drift(T_odom_cam, result);
    scale_.follow(T_odom_cam.translation(), tracker_.current().cloud.get());
    motion_.update(packet.t, T_odom_cam, drift_, result.sure || fixed || (motion && motion->legs));

    PoseEstimate estimate = estimate_at(packet, T_odom_cam);
    estimate.source = result.source;
    estimate.visual_inliers = result.solution.visual_inliers;
    estimate.depth_inliers = result.solution.depth_inliers;
    const Matrix6d covariance = covariance_in_odom(T_odom_cam);
    estimate.covariance = stated(covariance, T_odom_cam);
    if (fixed) {
      estimate.status = result.solution.seen_whole() ? fixed_status() : TrackingStatus::kDegraded;
    } else {
      estimate.status = reckoned_status(motion);
    }
    estimate.quality = result.quality();
    if (begin_anew || (fixed && needs_keyframe(packet, result, T_odom_cam))) {
      keyframe_due_ = covariance;
      // Legs tie what they were heard all the way between; without them nothing does.
      part_due_ = begin_anew && !(since_keyframe_ && since_keyframe_->legs);
    }
    frames_.add(packet.t, reference_, map_.keyframe(reference_).T_odom_cam.inverse() * T_odom_cam);
    return estimate;
  }

  /// The estimator's own frame is the map, though its name within is odom: there is but one. To
  /// others the odom frame is where it would be had no loop been closed.
  void place(PoseEstimate& estimate, const SE3& T_map_cam) const {
    estimate.map_id = static_cast<std::uint32_t>(map_.newest_part());
    estimate.T_map_odom = T_map_odom_;
    estimate.T_odom_base = T_map_odom_.inverse() * (T_map_cam * T_base_cam_.inverse());
  }

  /// Of a frame that something seen has fixed: in a part that is tied to nothing older, the place
  /// in the map is still looked for.
  [[nodiscard]] TrackingStatus fixed_status() const {
    return map_.is_tied() ? TrackingStatus::kTracking : TrackingStatus::kRelocalising;
  }

  /// Of a frame that nothing seen has fixed. Legs tell a way for as long as they are heard; without
  /// them it is soon anywhere.
  [[nodiscard]] TrackingStatus reckoned_status(const std::optional<ReckonedMotion>& motion) const {
    constexpr double kLostM = 1;
    const double variance = drift_.bottomRightCorner<3, 3>().diagonal().maxCoeff();
    return !(motion && motion->legs) && variance > kLostM * kLostM ? TrackingStatus::kLost
                                                                   : TrackingStatus::kDegraded;
  }

  [[nodiscard]] PoseEstimate estimate_at(const SyncedPacket& packet, const SE3& T_odom_cam) const {
    PoseEstimate estimate;
    estimate.t = packet.t;
    estimate.sequence = packet.sequence;
    estimate.reset_counter = reset_counter_;
    place(estimate, T_odom_cam);
    // The twist of the base in the base, by the adjoint; its translation turned into odom.
    const Vector6d twist_base = T_base_cam_.adjoint() * motion_.velocity();
    estimate.w_base = twist_base.head<3>();
    estimate.v_odom_base = estimate.T_odom_base.rotation() * twist_base.tail<3>();
    return estimate;
  }

  /// A frame's error in respect of the reference keyframe: that of one registration, or, since the
  /// thread was lost, of all steps in turn. A prediction tells of all of them by itself.
  void drift(const SE3& T_odom_cam, const TrackingResult& result) {
    if (result.anchored || !result.sure) {
      drift_ = result.covariance;
    } else {
      const Matrix6d by_step = (T_odom_cam.inverse() * T_odom_cam_).adjoint();
      drift_ = by_step * drift_ * by_step.transpose() + result.covariance;
    }
    T_odom_cam_ = T_odom_cam;
  }

  /// Covariance of T_odom_cam: that of the reference keyframe, carried to this frame, and the
  /// drift() since.
  [[nodiscard]] Matrix6d covariance_in_odom(const SE3& T_odom_cam) const {
    const Keyframe& reference = map_.keyframe(reference_);
    const Matrix6d A = (T_odom_cam.inverse() * reference.T_odom_cam).adjoint();
    return A * reference.covariance * A.transpose() + drift_;
  }

  /// Of the base, what is stated of a pose of the camera: its covariance in the map, and how far
  /// the map may be too large or too small.
  [[nodiscard]] Matrix6d stated(const Matrix6d& covariance, const SE3& T_odom_cam) const {
    const Matrix3d R_cam_odom = T_odom_cam.rotation_matrix().transpose();
    Matrix6d whole = covariance;
    whole.bottomRightCorner<3, 3>() += R_cam_odom * scale_.covariance() * R_cam_odom.transpose();
    const Matrix6d A = T_base_cam_.adjoint();
    return A * whole * A.transpose();
  }

  [[nodiscard]] std::optional<PosePrior> since_keyframe() const {
    if (!since_keyframe_ || !since_keyframe_->legs) {
      return std::nullopt;
    }
    const SE3& T_odom_cam0 = map_.keyframe(reference_).T_odom_cam;
    return PosePrior{.T_odom_cam = T_odom_cam0 * since_keyframe_->T_cam0_cam1,
                     .information = inverse(since_keyframe_->covariance)};
  }

  static PoseSource source_of(const std::optional<ReckonedMotion>& motion) {
    if (!motion) {
      return PoseSource::kConstantVelocity;
    }
    return motion->legs ? PoseSource::kLegs : PoseSource::kImu;
  }

  [[nodiscard]] bool needs_keyframe(const SyncedPacket& packet, const TrackingResult& result,
                                    const SE3& T_odom_cam) const {
    const Keyframe& reference = map_.keyframe(reference_);
    // Where nothing but the features has changed, a new view tells nothing new.
    constexpr double kSameViewM = 0.03;
    constexpr double kSameViewRad = 0.03;
    const Vector6d moved = (reference.T_odom_cam.inverse() * T_odom_cam).log();
    const bool new_view =
        moved.tail<3>().norm() > kSameViewM || moved.head<3>().norm() > kSameViewRad;
    const bool old = packet.t - reference.t > config_.keyframes.maximum_interval;
    const double share = static_cast<double>(result.solution.visual_inliers) /
                         static_cast<double>(reference.points.size() + 1);
    // Of features many are lost whatever the view. Where depth carries on, it tells what is left of
    // it: on a white wall each keyframe more is one more registration's error.
    const double in_view = result.depth_fix ? result.overlap : 2 * share;
    return moved.tail<3>().norm() > config_.keyframes.translation_m ||
           moved.head<3>().norm() > config_.keyframes.rotation_rad ||
           (new_view && in_view < config_.keyframes.overlap) ||
           (old && (new_view || share < config_.keyframes.overlap));
  }

  void insert_keyframe(const Matrix6d& covariance) {
    const StageScope scope{observer_, Stage::kKeyframe};
    if (std::exchange(part_due_, false)) {
      map_.begin_part();
      since_keyframe_.reset();
    }
    const KeyframeId before = reference_;
    reference_ = builder_.insert(map_, tracker_.current(), covariance);
    map_.keyframe(reference_).up = up_;
    if (map_.keyframes().size() > 1) {
      pending_ = reference_;
      if (since_keyframe_) {
        const RelativeEdge edge{.from = before,
                                .to = reference_,
                                .T_from_to = since_keyframe_->T_cam0_cam1,
                                .information = inverse(since_keyframe_->covariance),
                                .kind = EdgeKind::kReckoned};
        map_.add_edge(edge);
        map_.keyframe(reference_).gyro = since_keyframe_->gyro;
        if (since_keyframe_->legs) {
          map_.keyframe(reference_).reckoned = edge;
        }
      }
    }
    since_keyframe_ = ReckonedMotion{.T_cam0_cam1 = SE3{}, .legs = true};
    map_.read_clouds_near(reference_, kNearM, kCloudsAtOnce);
  }

  Config config_;
  GicpConfig gicp_;
  Calibration calibration_;
  SE3 T_base_cam_;
  DeadReckoner reckoner_;
  Tracker tracker_;
  MapBuilder builder_;
  LoopCloser loop_closer_;
  MotionModel motion_;
  DepthScale scale_;
  Map map_;
  KeyframeId reference_{};
  std::optional<Matrix6d> keyframe_due_;  ///< covariance of the last frame, which is to become one
  std::optional<KeyframeId> pending_;
  std::optional<ReckonedMotion> since_keyframe_;  ///< none where some of it is not known
  std::optional<UpDirection> up_;                 ///< in the camera's frame, at the last packet
  bool part_due_ = false;       ///< the last frame, which is to become a keyframe, begins one
  bool loop_found_ = false;     ///< the map is to be corrected
  bool global_due_ = false;     ///< it has been: all of it is to be adjusted
  std::uint32_t revision_ = 0;  ///< how often all of the map has moved
  SE3 T_map_odom_;              ///< what closed loops have moved the map by
  FollowedFrames frames_;
  bool begun_ = false;                 ///< there is a keyframe
  bool carried_ = false;               ///< before it, legs have told of a way
  SE3 T_odom_cam_;                     ///< of the last frame
  Matrix6d drift_ = Matrix6d::Zero();  ///< of the last frame in respect of the map
  int frames_lost_ = 0;
  std::uint32_t reset_counter_ = 0;
  StageObserver* observer_;
};

}  // namespace geoflow::slam
