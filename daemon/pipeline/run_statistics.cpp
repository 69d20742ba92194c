#include "geoflow/daemon/run_statistics.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include "geoflow/daemon/time_histogram.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/stage.hpp"
#include "geoflow/timesync/clock_fit.hpp"
#include "geoflow/timesync/counters.hpp"

namespace geoflow::daemon {
namespace {

using nlohmann::json;

json to_json(const timesync::StreamCounters& counters) {
  return {{"pushed", counters.pushed},       {"used", counters.used},
          {"unused", counters.unused},       {"late", counters.late},
          {"duplicate", counters.duplicate}, {"invalid", counters.invalid},
          {"outlier", counters.outlier},     {"overflow", counters.overflow},
          {"reordered", counters.reordered}, {"silences", counters.silences}};
}

json to_json(const timesync::ClockCounters& counters) {
  return {
      {"samples", counters.samples}, {"outliers", counters.outliers}, {"jumps", counters.jumps}};
}

/// All that is timed, by the name that reports have for it.
std::vector<std::pair<std::string, const TimeHistogram*>> histograms(
    const RunStatistics& statistics) {
  std::vector<std::pair<std::string, const TimeHistogram*>> named{
      {"process", &statistics.process},
      {"arrival_to_pose", &statistics.delivery},
      {"imu_to_pose", &statistics.propagation}};
  for (std::size_t i = 0; i < slam::kStageCount; ++i) {
    const auto stage = static_cast<slam::Stage>(i);
    const StageTimer& timer = stage == slam::Stage::kMapping         ? statistics.mapping
                              : stage == slam::Stage::kGlobalMapping ? statistics.global_mapping
                                                                     : statistics.tracking;
    named.emplace_back(to_string(stage), &timer.histogram(stage));
  }
  return named;
}

}  // namespace

void StageTimer::begin(slam::Stage stage) {
  began_[static_cast<std::size_t>(stage)] = HostClock::now();
}

void StageTimer::end(slam::Stage stage) {
  const auto i = static_cast<std::size_t>(stage);
  histograms_[i].add(HostClock::now() - began_[i]);
}

bool has_pose(TrackingStatus status) noexcept {
  return status == TrackingStatus::kTracking || status == TrackingStatus::kDegraded ||
         status == TrackingStatus::kRelocalising;
}

std::uint64_t RunStatistics::frames_with_pose() const noexcept {
  std::uint64_t frames = 0;
  for (std::size_t i = 0; i < kStatusCount; ++i) {
    frames += has_pose(static_cast<TrackingStatus>(i)) ? counters.by_status[i].load() : 0;
  }
  return frames;
}

std::uint64_t RunStatistics::frames() const noexcept {
  std::uint64_t frames = 0;
  for (const auto& count : counters.by_status) {
    frames += count.load();
  }
  return frames;
}

json to_json(const TimeSummary& summary) {
  return {{"count", summary.count},
          {"mean", summary.mean_ms},
          {"p50", summary.p50_ms},
          {"p99", summary.p99_ms},
          {"max", summary.max_ms}};
}

json to_json(const RunStatistics& statistics) {
  const RunCounters& counters = statistics.counters;
  json by_status = json::object();
  for (std::size_t i = 0; i < kStatusCount; ++i) {
    by_status[to_string(static_cast<TrackingStatus>(i))] = counters.by_status[i].load();
  }
  json times = json::object();
  for (const auto& [name, histogram] : histograms(statistics)) {
    times[name] = to_json(histogram->summary());
  }
  return {{"frames", statistics.frames()},
          {"tracked", statistics.frames_with_pose()},
          {"by_status", std::move(by_status)},
          {"drops",
           {{"color", counters.color_dropped.load()},
            {"depth", counters.depth_dropped.load()},
            {"samples", counters.samples_dropped.load()},
            {"packets", counters.packets_dropped.load()}}},
          {"delivered",
           {{"color", counters.color_frames.load()}, {"depth", counters.depth_frames.load()}}},
          {"rejected", counters.rejected.load()},
          {"mapping_runs", counters.mapping_runs.load()},
          {"times_ms", std::move(times)}};
}

json histograms_to_json(const RunStatistics& statistics) {
  json all = json::object();
  for (const auto& [name, histogram] : histograms(statistics)) {
    json buckets = json::array();
    for (const TimeBucket& bucket : histogram->buckets()) {
      buckets.push_back({bucket.lower_ms, bucket.upper_ms, bucket.count});
    }
    all[name] = std::move(buckets);
  }
  return all;
}

json to_json(const timesync::SynchroniserCounters& counters) {
  return {{"color", to_json(counters.color)},
          {"depth", to_json(counters.depth)},
          {"imu", to_json(counters.imu)},
          {"legs", to_json(counters.legs)},
          {"body_velocity", to_json(counters.body_velocity)},
          {"camera_clock", to_json(counters.camera_clock)},
          {"imu_clock", to_json(counters.imu_clock)},
          {"leg_clock", to_json(counters.leg_clock)},
          {"packets", counters.packets},
          {"blind", counters.blind},
          {"depth_missing", counters.depth_missing},
          {"depth_shared", counters.depth_shared},
          {"wait_expired", counters.wait_expired}};
}

double peak_memory_mib() noexcept {
  constexpr double kKibPerMib = 1024;
  rusage usage{};
  return ::getrusage(RUSAGE_SELF, &usage) == 0 ? static_cast<double>(usage.ru_maxrss) / kKibPerMib
                                               : 0.0;
}

}  // namespace geoflow::daemon
