#include "geoflow/daemon/run.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <malloc.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/saved_map.hpp"

namespace geoflow::daemon {
namespace {

std::optional<std::filesystem::path> if_given(const std::filesystem::path& path) {
  return path.empty() ? std::nullopt : std::optional{path};
}

drivers::RecordingOptions recording_options(const Config& config) {
  return {.path = config.source.replay,
          .calibration = if_given(config.source.calibration),
          .topics = config.topics,
          .can_dictionary = if_given(config.can.dictionary),
          .faults = if_given(config.source.faults),
          .fault_seed = config.source.fault_seed,
          .color_as_gray = true};
}

/// The device that source.legs names; null where it names none.
Result<std::unique_ptr<Legs>> open_legs(const Config& config) {
  const std::string& device = config.source.legs;
  if (device.empty()) {
    return nullptr;
  }
  if (device != "can") {
    return fail(ErrorCode::kInvalidArgument, "source.legs: '{}' is no device; there is: can",
                device);
  }
  if (!config.source.realtime) {
    return fail(ErrorCode::kInvalidArgument,
                "source.legs: a device keeps its own pace, so source.realtime must be true");
  }
  return drivers::open_can_legs(config.can);
}

/// Every frame allocates and frees the same image-sized blocks. By default glibc gives such blocks
/// back to the kernel, and each frame pays their page faults again.
void keep_freed_memory() {
  constexpr int kNeverMapSeparatelyBytes = 1 << 30;
  constexpr int kKeepBytes = 1 << 28;
  // NOLINTBEGIN(concurrency-mt-unsafe): of the run's threads none exists yet
  ::mallopt(M_MMAP_THRESHOLD, kNeverMapSeparatelyBytes);
  ::mallopt(M_TRIM_THRESHOLD, kKeepBytes);
  // NOLINTEND(concurrency-mt-unsafe)
}

/// The configured map; null where none is.
Result<std::shared_ptr<const slam::StoredMap>> saved_map(const MapConfig& config,
                                                         const Calibration& calibration) {
  if (config.file.empty()) {
    return nullptr;
  }
  return slam::load_map(config.file).and_then([&](auto map) {
    return slam::made_with(*map, calibration).map([&] { return map; }).map_error([&](Error error) {
      return std::move(error).in(config.file.string());
    });
  });
}

}  // namespace

Ports Run::ports() {
  return {.camera = streams->camera(),
          .imu = streams->imu(),
          .legs = legs ? legs.get() : streams->legs()};
}

Result<Run> open_run(const Config& config) {
  if (config.source.replay.empty()) {
    return fail(ErrorCode::kInvalidArgument, "source.replay: no recording is named (--replay DIR)");
  }
  keep_freed_memory();
  Run run;
  auto streams = drivers::RecordedStreams::open(recording_options(config));
  if (!streams) {
    return tl::unexpected{std::move(streams.error())};
  }
  run.streams = std::move(*streams);
  auto legs = open_legs(config);
  if (!legs) {
    return tl::unexpected{std::move(legs.error())};
  }
  run.legs = std::move(*legs);
  run.statistics = std::make_unique<RunStatistics>();
  auto map = saved_map(config.map, run.streams->calibration());
  if (!map) {
    run.map_refused = std::move(map.error());
  }
  auto core = slam::Core::create(run.streams->calibration(), config.slam, &run.statistics->tracking,
                                 map ? map->get() : nullptr);
  if (!core) {
    return tl::unexpected{std::move(core.error())};
  }
  run.core = std::move(*core);
  return run;
}

}  // namespace geoflow::daemon
