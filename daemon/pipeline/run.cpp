#include "geoflow/daemon/run.hpp"

#include <memory>
#include <utility>

#include <malloc.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/sources.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/propagator.hpp"
#include "geoflow/slam/saved_map.hpp"

#include "map/map_files.hpp"

namespace geoflow::daemon {
namespace {

bool names_images(const SourceConfig& source) {
  return !source.camera.empty() || !source.replay.empty();
}

tl::unexpected<Error> no_images() {
  return fail(ErrorCode::kInvalidArgument,
              "source: neither a recording (replay, --replay DIR) nor a camera is named");
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
  return load_own_map(config.file, calibration);
}

}  // namespace

Result<void> check_source(const Config& config) {
  return names_images(config.source) ? check_sources(config) : no_images();
}

Result<Run> open_run(const Config& config) {
  if (!names_images(config.source)) {
    return no_images();
  }
  return open_sources(config, PixelFormat::kGray8).and_then([&](Sources sources) {
    return make_run(config, std::move(sources));
  });
}

Result<Run> make_run(const Config& config, Sources sources) {
  if (sources.ports().camera == nullptr) {
    return no_images();
  }
  keep_freed_memory();
  Run run{std::move(sources)};
  run.statistics = std::make_unique<RunStatistics>();
  auto map = saved_map(config.map, run.calibration);
  if (!map) {
    run.map_refused = std::move(map.error());
  }
  auto core = slam::Core::create(run.calibration, config.slam, &run.statistics->tracking,
                                 map ? map->get() : nullptr);
  if (!core) {
    return tl::unexpected{std::move(core.error())};
  }
  run.core = std::move(*core);
  if (run.ports().imu != nullptr) {
    run.propagator = slam::Propagator::create(run.calibration, config.slam.switches);
  }
  return run;
}

}  // namespace geoflow::daemon
