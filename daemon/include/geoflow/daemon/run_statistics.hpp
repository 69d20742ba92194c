#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/time_histogram.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/stage.hpp"
#include "geoflow/timesync/counters.hpp"

namespace geoflow::daemon {

inline constexpr std::size_t kStatusCount = 6;  ///< of TrackingStatus

/// Counters of one run. Each is written by one thread; all may be read by any, at any time.
struct RunCounters {
  std::atomic<std::uint64_t> color_frames{0};     ///< that the source delivered
  std::atomic<std::uint64_t> depth_frames{0};     ///< likewise
  std::atomic<std::uint64_t> color_dropped{0};    ///< for want of room before the synchroniser
  std::atomic<std::uint64_t> depth_dropped{0};    ///< likewise
  std::atomic<std::uint64_t> samples_dropped{0};  ///< likewise: IMU, legs and body velocity
  std::atomic<std::uint64_t> packets{0};          ///< that the synchroniser made
  std::atomic<std::uint64_t> packets_dropped{0};  ///< because the estimator was behind
  std::atomic<std::uint64_t> rejected{0};         ///< samples that could not be decoded
  std::atomic<std::uint64_t> mapping_runs{0};     ///< local bundle adjustments applied
  std::array<std::atomic<std::uint64_t>, kStatusCount>
      by_status{};  ///< estimates, by TrackingStatus
};

/// Measures the estimator's stages, each into its own histogram.
class StageTimer final : public slam::StageObserver {
 public:
  void begin(slam::Stage stage) override;
  void end(slam::Stage stage) override;
  [[nodiscard]] const TimeHistogram& histogram(slam::Stage stage) const noexcept {
    return histograms_[static_cast<std::size_t>(stage)];
  }

 private:
  std::array<TimeHistogram, slam::kStageCount> histograms_;
  std::array<HostTime, slam::kStageCount> began_;
};

/// All that is measured of one run.
struct RunStatistics {
  RunCounters counters;
  StageTimer tracking;        ///< stages on the estimator's thread
  StageTimer mapping;         ///< stages of mapping, on its own thread or in lock step
  StageTimer global_mapping;  ///< likewise, of the adjustment of the whole map
  TimeHistogram process;      ///< Core::process, all its stages and what is between them
  TimeHistogram delivery;     ///< live: from a frame's arrival to its estimate
  TimeHistogram propagation;  ///< live: from an IMU sample's arrival to its pose

  /// Frames whose estimate has a pose: TRACKING, DEGRADED or RELOCALISING.
  [[nodiscard]] std::uint64_t frames_with_pose() const noexcept;
  [[nodiscard]] std::uint64_t frames() const noexcept;  ///< estimates so far
};

/// Whether an estimate of this status carries a pose worth writing down.
[[nodiscard]] bool has_pose(TrackingStatus status) noexcept;

/// `{"count":…,"mean":…,"p50":…,"p99":…,"max":…}`, times in ms.
[[nodiscard]] nlohmann::json to_json(const TimeSummary& summary);
/// The keys "frames", "tracked", "by_status", "drops", "rejected" and "times_ms" of docs/cli.md.
[[nodiscard]] nlohmann::json to_json(const RunStatistics& statistics);
/// The key "time_histograms_ms" of docs/cli.md.
[[nodiscard]] nlohmann::json histograms_to_json(const RunStatistics& statistics);
/// The key "synchroniser" of docs/cli.md.
[[nodiscard]] nlohmann::json to_json(const timesync::SynchroniserCounters& counters);

/// The process's largest resident memory so far.
[[nodiscard]] double peak_memory_mib() noexcept;

}  // namespace geoflow::daemon
