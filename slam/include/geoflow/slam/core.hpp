#pragma once

#include <memory>
#include <optional>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/slam/stage.hpp"

namespace geoflow::slam {

/// The estimator. It owns no thread, no clock and no device: packets in, estimates out, the same
/// packets give the same estimates bit for bit on one machine. Thread-bound: all calls from one
/// thread at a time.
///
/// The odom frame is the base frame of the first packet.
///
///     auto core = Core::create(calibration, config).value();
///     for (packet : packets) {
///       const PoseEstimate estimate = core->process(packet);
///       if (auto task = core->take_mapping_task()) {
///         core->apply(optimise(*task));  // in lock step; or on another thread, applied between
///         two later packets
///       }
///     }
class Core {
  class Impl;

 public:
  /// Errors: kInvalidArgument for a calibration without image size or focal length, or a
  /// configuration value out of range. `observer` may be null; it must outlive the Core.
  /// With a `saved` map (null: none) made with this calibration (made_with()), the Core looks for
  /// its place there: until it finds it, estimates are of a part of its own, with status
  /// kRelocalising.
  [[nodiscard]] static Result<std::unique_ptr<Core>> create(const Calibration& calibration,
                                                            const Config& config,
                                                            StageObserver* observer = nullptr,
                                                            const StoredMap* saved = nullptr);
  /// For create(): nobody else has an Impl.
  explicit Core(std::unique_ptr<Impl> impl);
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;
  ~Core();

  /// Tracks one packet. Never fails: what could not be estimated is said by the estimate's status.
  /// A packet without an image, or with one of another size than the calibration's, is answered by
  /// what legs and IMU say, with status kDegraded. So are those before the first frame with depth,
  /// at which the map begins; with status kInitialising until legs have told of a way.
  [[nodiscard]] PoseEstimate process(const SyncedPacket& packet);

  /// Makes the last frame a keyframe if it is to be one: apart from process(), so that its pose
  /// need not wait for what later frames gain by that. The next call of process() or
  /// take_mapping_task() does it otherwise.
  void extend_map();

  /// A snapshot for one local bundle adjustment, once after each keyframe; nothing otherwise.
  [[nodiscard]] std::optional<MappingTask> take_mapping_task();

  /// A snapshot for one adjustment of the whole map (global bundle adjustment), once after each
  /// correction for loops; nothing otherwise. It may take seconds and be worked on beside tasks of
  /// take_mapping_task(); one at a time.
  [[nodiscard]] std::optional<MappingTask> take_global_task();

  /// Takes over the result of a task of this Core, of either kind. Keyframes made since the task
  /// was taken keep their pose relative to its newest keyframe.
  void apply(const MappingResult& result);

  /// How long the colour camera takes to read its rows out, as its features have shown [s].
  struct Readout {
    double mean_s = 0;
    double sigma_s = 0;
  };
  [[nodiscard]] Readout readout() const;

  /// T_odom_base of every frame that was tracked, after all optimisation so far, in order of time.
  [[nodiscard]] Trajectory final_trajectory() const;

  /// The map as it is now, with the saved one that it began with. Shares what is heavy, so that it
  /// may be written in another thread.
  [[nodiscard]] std::shared_ptr<const StoredMap> snapshot() const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace geoflow::slam
