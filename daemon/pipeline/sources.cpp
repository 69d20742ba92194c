#include "geoflow/daemon/sources.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/d435i.hpp"
#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/drivers/openni2_camera.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "pipeline/camera_calibration.hpp"

namespace geoflow::daemon {
namespace {

std::optional<std::filesystem::path> if_given(const std::filesystem::path& path) {
  return path.empty() ? std::nullopt : std::optional{path};
}

drivers::RecordingOptions recording_options(const Config& config, PixelFormat color) {
  return {.path = config.source.replay,
          .calibration = if_given(config.source.calibration),
          .topics = config.topics,
          .can_dictionary = if_given(config.can.dictionary),
          .faults = if_given(config.source.faults),
          .fault_seed = config.source.fault_seed,
          .color_as_gray = color == PixelFormat::kGray8};
}

tl::unexpected<Error> body_imu_without_place() {
  return fail(
      ErrorCode::kInvalidArgument,
      "source.imu: the body's IMU is of no use where the calibration does not say where the "
      "camera is on the robot (T_base_cam)");
}

/// Takes legs, IMU or both from a robot on DDS. The body's IMU stands elsewhere than the camera's.
Result<void> open_robot(const Config& config, Sources& sources) {
  const bool with_imu = !config.source.imu.empty();
  const bool with_camera = sources.ports().camera != nullptr;
  if (with_imu && with_camera && !sources.calibration.T_base_cam) {
    return body_imu_without_place();
  }
  auto opened = drivers::DdsRobot::open(config.dds);
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  const std::shared_ptr<drivers::DdsRobot> robot = std::move(*opened);
  if (!config.source.legs.empty() && !sources.legs) {
    sources.legs = {robot, &robot->legs()};
  }
  if (with_imu) {
    sources.imu = {robot, &robot->body_imu()};
  }
  if (with_imu && with_camera) {
    const SE3 T_base_cam = *sources.calibration.T_base_cam;
    const SE3 T_base_imu = drivers::body_imu_in_base();
    sources.calibration.T_cam_imu = T_base_cam.inverse() * T_base_imu;
    sources.calibration.timeshift_cam_imu = {};
  }
  return {};
}

Result<void> open_recording(const Config& config, PixelFormat color, Sources& sources) {
  auto streams = drivers::RecordedStreams::open(recording_options(config, color));
  if (!streams) {
    return tl::unexpected{std::move(streams.error())};
  }
  sources.streams = std::move(*streams);
  sources.calibration = sources.streams->calibration();
  return {};
}

Result<drivers::D435iOptions> d435i_options(const CameraConfig& config, PixelFormat color) {
  drivers::D435iOptions options{.serial = config.serial,
                                .width = config.width,
                                .height = config.height,
                                .rate_hz = config.rate_hz,
                                .accel_hz = config.accel_hz,
                                .gyro_hz = config.gyro_hz,
                                .emitter = config.emitter,
                                .laser_power_mw = config.laser_power_mw,
                                .color_as_gray = color == PixelFormat::kGray8};
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

Result<std::unique_ptr<drivers::LiveCamera>> open_d435i(const CameraConfig& config,
                                                        PixelFormat color) {
  return d435i_options(config, color)
      .and_then([](const auto& options) { return drivers::D435i::open(options); })
      .map([](auto camera) -> std::unique_ptr<drivers::LiveCamera> { return camera; });
}

Result<std::unique_ptr<drivers::LiveCamera>> open_openni2(const OpenNi2Config& config,
                                                          PixelFormat color) {
  return drivers::open_openni2_camera({.uri = config.uri,
                                       .width = config.width,
                                       .height = config.height,
                                       .rate_hz = config.rate_hz,
                                       .color_as_gray = color == PixelFormat::kGray8});
}

constexpr std::string_view kD435i = "d435i";
constexpr std::string_view kOpenNi2 = "openni2";

Result<void> open_camera(const Config& config, PixelFormat color, Sources& sources) {
  auto camera = config.source.camera == kD435i ? open_d435i(config.d435i, color)
                                               : open_openni2(config.openni2, color);
  if (!camera) {
    return tl::unexpected{std::move(camera.error())};
  }
  sources.camera = std::move(*camera);
  sources.calibration = sources.camera->calibration();
  if (sources.camera->imu() != nullptr) {
    sources.calibration.imu_noise.rate_hz = config.d435i.gyro_hz;
  }
  return config.source.calibration.empty()
             ? Result<void>{}
             : complete_calibration(config.source.calibration, config.source.camera == kOpenNi2,
                                    sources.calibration);
}

constexpr std::string_view kCan = "can";
constexpr std::string_view kDds = "dds";

/// Makes the devices that source.legs and source.imu name stand in for the recording's.
Result<void> open_devices(const Config& config, Sources& sources) {
  const std::string& legs = config.source.legs;
  if (legs == kCan) {
    auto can = drivers::open_can_legs(config.can);
    if (!can) {
      return tl::unexpected{std::move(can.error())};
    }
    sources.legs = std::move(*can);
  }
  return legs == kDds || config.source.imu == kDds ? open_robot(config, sources) : Result<void>{};
}

Result<void> check_camera(const Config& config) {
  const SourceConfig& source = config.source;
  if (source.camera != kD435i && source.camera != kOpenNi2) {
    return fail(ErrorCode::kInvalidArgument,
                "source.camera: '{}' is no device; there are: d435i, openni2", source.camera);
  }
  if (!source.replay.empty() || !source.realtime) {
    return fail(ErrorCode::kInvalidArgument,
                "source.camera: a device keeps its own pace: source.replay must be empty and "
                "source.realtime true");
  }
  if (auto options = d435i_options(config.d435i, PixelFormat::kGray8); !options) {
    return tl::unexpected{std::move(options.error())};
  }
  Calibration calibration;
  if (!source.calibration.empty()) {
    auto completed = complete_calibration(source.calibration, false, calibration);
    if (!completed) {
      return completed;
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

}  // namespace

Ports Sources::ports() {
  Ports ports{.imu = imu.get(), .legs = legs.get()};
  if (camera) {
    ports.camera = &camera->camera();
    ports.imu = imu ? imu.get() : camera->imu();
  } else if (streams) {
    ports.camera = &streams->camera();
    ports.imu = imu ? imu.get() : streams->imu();
    ports.legs = legs ? legs.get() : streams->legs();
  }
  return ports;
}

Result<void> Sources::play(const std::stop_token& stop) const {
  if (streams) {
    return streams->play(stop);
  }
  if (camera) {
    camera->run(stop);
  }
  return {};
}

ThreadActivity Sources::activity() const {
  constexpr std::string_view kName = "replay";
  if (camera) {
    return {.name = kName, .turns = camera->turns()};
  }
  if (!streams) {
    return {.name = kName, .idle = true};
  }
  const auto reached_ns = streams->now().time_since_epoch().count();
  const auto until = streams->waits_until();
  return {.name = kName,
          .turns = static_cast<std::uint64_t>(reached_ns),
          .idle = until && HostClock::now() < *until};
}

HostTime Sources::to_recording_time(HostTime t) const {
  return streams ? streams->to_recording_time(t) : t;
}

Result<void> check_sources(const Config& config) {
  auto devices = check_devices(config.source);
  return devices && !config.source.camera.empty() ? check_camera(config) : std::move(devices);
}

Result<Sources> open_sources(const Config& config, PixelFormat color) {
  Sources sources;
  auto opened = check_sources(config);
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  if (!config.source.camera.empty()) {
    opened = open_camera(config, color, sources);
  } else if (!config.source.replay.empty()) {
    opened = open_recording(config, color, sources);
  }
  opened = opened.and_then([&] { return open_devices(config, sources); });
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  return sources;
}

}  // namespace geoflow::daemon
