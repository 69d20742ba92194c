#include "geoflow/daemon/run.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include <malloc.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/d435i.hpp"
#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/propagator.hpp"
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

tl::unexpected<Error> body_imu_without_place() {
  return fail(
      ErrorCode::kInvalidArgument,
      "source.imu: the body's IMU is of no use where the calibration does not say where the "
      "camera is on the robot (T_base_cam)");
}

/// Takes legs, IMU or both from a robot on DDS. The body's IMU stands elsewhere than the camera's.
Result<void> open_robot(const Config& config, Run& run) {
  const bool with_imu = !config.source.imu.empty();
  if (with_imu && !run.calibration.T_base_cam) {
    return body_imu_without_place();
  }
  auto opened = drivers::DdsRobot::open(config.dds);
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  const std::shared_ptr<drivers::DdsRobot> robot = std::move(*opened);
  if (!config.source.legs.empty() && !run.legs) {
    run.legs = {robot, &robot->legs()};
  }
  if (with_imu) {
    run.imu = {robot, &robot->body_imu()};
    const SE3 T_base_cam = *run.calibration.T_base_cam;
    const SE3 T_base_imu = drivers::body_imu_in_base();
    run.calibration.T_cam_imu = T_base_cam.inverse() * T_base_imu;
    run.calibration.timeshift_cam_imu = {};
  }
  return {};
}

Result<void> open_recording(const Config& config, Run& run) {
  auto streams = drivers::RecordedStreams::open(recording_options(config));
  if (!streams) {
    return tl::unexpected{std::move(streams.error())};
  }
  run.streams = std::move(*streams);
  run.calibration = run.streams->calibration();
  return {};
}

Result<drivers::D435iOptions> d435i_options(const CameraConfig& config) {
  drivers::D435iOptions options{.serial = config.serial,
                                .width = config.width,
                                .height = config.height,
                                .rate_hz = config.rate_hz,
                                .accel_hz = config.accel_hz,
                                .gyro_hz = config.gyro_hz,
                                .emitter = config.emitter,
                                .laser_power_mw = config.laser_power_mw,
                                .color_as_gray = true};
  if (config.exposure_us > 0) {
    options.exposure_us = config.exposure_us;
  }
  if (config.transport == "v4l2") {
    options.transport = drivers::D435iTransport::kV4l2;
  } else if (config.transport == "libusb") {
    options.transport = drivers::D435iTransport::kLibusb;
  } else if (config.transport != "auto") {
    return fail(ErrorCode::kInvalidArgument,
                "d435i.transport: '{}' is no way to the camera; there are: auto, v4l2, libusb",
                config.transport);
  }
  return options;
}

/// What a file says of the robot, on a camera that knows its own intrinsics.
Result<void> overlay_calibration(const std::filesystem::path& directory, Calibration& calibration) {
  auto file = drivers::load_calibration(directory);
  if (!file) {
    return tl::unexpected{std::move(file.error())};
  }
  calibration.T_base_cam = file->T_base_cam;
  if (file->T_cam_imu) {
    calibration.T_cam_imu = file->T_cam_imu;
    calibration.timeshift_cam_imu = file->timeshift_cam_imu;
  }
  calibration.imu_noise = file->imu_noise;
  calibration.source += ", " + file->source;
  return {};
}

Result<void> open_camera(const Config& config, Run& run) {
  const auto options = d435i_options(config.d435i);
  if (!options) {
    return tl::unexpected{options.error()};
  }
  auto camera = drivers::D435i::open(*options);
  if (!camera) {
    return tl::unexpected{std::move(camera.error())};
  }
  run.camera = std::move(*camera);
  run.calibration = run.camera->calibration();
  run.calibration.imu_noise.rate_hz = config.d435i.gyro_hz;
  return config.source.calibration.empty()
             ? Result<void>{}
             : overlay_calibration(config.source.calibration, run.calibration);
}

constexpr std::string_view kCan = "can";
constexpr std::string_view kDds = "dds";

/// Makes the devices that source.legs and source.imu name stand in for the recording's.
Result<void> open_devices(const Config& config, Run& run) {
  const std::string& legs = config.source.legs;
  if (legs == kCan) {
    auto can = drivers::open_can_legs(config.can);
    if (!can) {
      return tl::unexpected{std::move(can.error())};
    }
    run.legs = std::move(*can);
  }
  return legs == kDds || config.source.imu == kDds ? open_robot(config, run) : Result<void>{};
}

Result<void> check_camera(const Config& config) {
  const SourceConfig& source = config.source;
  if (source.camera != "d435i") {
    return fail(ErrorCode::kInvalidArgument, "source.camera: '{}' is no device; there is: d435i",
                source.camera);
  }
  if (!source.replay.empty() || !source.realtime) {
    return fail(ErrorCode::kInvalidArgument,
                "source.camera: a device keeps its own pace: source.replay must be empty and "
                "source.realtime true");
  }
  if (auto options = d435i_options(config.d435i); !options) {
    return tl::unexpected{std::move(options.error())};
  }
  Calibration calibration;
  if (!source.calibration.empty()) {
    auto overlaid = overlay_calibration(source.calibration, calibration);
    if (!overlaid) {
      return overlaid;
    }
  }
  return source.imu.empty() || calibration.T_base_cam ? Result<void>{} : body_imu_without_place();
}

Result<void> check_devices(const SourceConfig& source) {
  if (!source.legs.empty() && source.legs != kCan && source.legs != kDds) {
    return fail(ErrorCode::kInvalidArgument, "source.legs: '{}' is no device; there are: can, dds",
                source.legs);
  }
  if (!source.imu.empty() && source.imu != kDds) {
    return fail(ErrorCode::kInvalidArgument, "source.imu: '{}' is no device; there is: dds",
                source.imu);
  }
  if ((!source.legs.empty() || !source.imu.empty()) && !source.realtime) {
    return fail(ErrorCode::kInvalidArgument,
                "source.legs, source.imu: a device keeps its own pace, so source.realtime must be "
                "true");
  }
  return {};
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
  if (camera) {
    return {
        .camera = camera->camera(), .imu = imu ? imu.get() : &camera->imu(), .legs = legs.get()};
  }
  return {.camera = streams->camera(),
          .imu = imu ? imu.get() : streams->imu(),
          .legs = legs ? legs.get() : streams->legs()};
}

Result<void> Run::play(const std::stop_token& stop) const {
  if (!camera) {
    return streams->play(stop);
  }
  camera->run(stop);
  return {};
}

ThreadActivity Run::activity() const {
  constexpr std::string_view kName = "replay";
  if (camera) {
    return {.name = kName, .turns = camera->status().turns};
  }
  const auto reached_ns = streams->now().time_since_epoch().count();
  const auto until = streams->waits_until();
  return {.name = kName,
          .turns = static_cast<std::uint64_t>(reached_ns),
          .idle = until && HostClock::now() < *until};
}

HostTime Run::to_recording_time(HostTime t) const {
  return streams ? streams->to_recording_time(t) : t;
}

Result<void> check_source(const Config& config) {
  if (config.source.camera.empty() && config.source.replay.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                "source: neither a recording (replay, --replay DIR) nor a camera is named");
  }
  auto devices = check_devices(config.source);
  return devices && !config.source.camera.empty() ? check_camera(config) : std::move(devices);
}

Result<Run> open_run(const Config& config) {
  if (auto checked = check_source(config); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  keep_freed_memory();
  Run run;
  auto opened =
      config.source.camera.empty() ? open_recording(config, run) : open_camera(config, run);
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  if (auto devices = open_devices(config, run); !devices) {
    return tl::unexpected{std::move(devices.error())};
  }
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
