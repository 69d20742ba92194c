#include "openni2/open_device.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <OniEnums.h>
#include <OpenNI.h>
#include <fmt/core.h>
#include <fmt/format.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/openni2_camera.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"

#include "openni2/pixels.hpp"

namespace geoflow::drivers::openni2 {
namespace {

constexpr int kLongestWait_ms = 50;
constexpr double kMillimetre_m = 1e-3;
constexpr double kTenthMillimetre_m = 1e-4;

Result<void> check(openni::Status status, std::string_view what) {
  if (status == openni::STATUS_OK) {
    return {};
  }
  std::string why = openni::OpenNI::getExtendedError();
  while (!why.empty() && (why.back() == '\n' || why.back() == ' ')) {
    why.pop_back();
  }
  return fail(status == openni::STATUS_NO_DEVICE ? ErrorCode::kNotFound : ErrorCode::kSystem,
              "OpenNI: {}{}{}", what, why.empty() ? "" : ": ", why);
}

std::string describe(const openni::VideoMode& mode) {
  return fmt::format("{}x{} at {} Hz", mode.getResolutionX(), mode.getResolutionY(), mode.getFps());
}

/// The first of the camera's modes of that size and rate whose pixels can be used.
Result<openni::VideoMode> choose_mode(const openni::SensorInfo& sensor,
                                      const OpenNi2Options& options, std::string_view name) {
  const auto& modes = sensor.getSupportedVideoModes();
  std::vector<std::string> others;
  for (int i = 0; i < modes.getSize(); ++i) {
    const openni::VideoMode& mode = modes[i];
    if (!source_pixel(mode.getPixelFormat())) {
      continue;
    }
    if (mode.getResolutionX() == options.width && mode.getResolutionY() == options.height &&
        mode.getFps() == options.rate_hz) {
      return mode;
    }
    others.push_back(describe(mode));
  }
  std::ranges::sort(others);
  const auto repeated = std::ranges::unique(others);
  others.erase(repeated.begin(), repeated.end());
  return fail(ErrorCode::kUnsupported, "OpenNI: no {} of {}x{} at {} Hz; there are: {}", name,
              options.width, options.height, options.rate_hz, fmt::join(others, ", "));
}

}  // namespace

std::optional<SourcePixel> source_pixel(openni::PixelFormat format) {
  switch (format) {
    case openni::PIXEL_FORMAT_DEPTH_1_MM:
    case openni::PIXEL_FORMAT_DEPTH_100_UM:
      return SourcePixel::kDepth;
    case openni::PIXEL_FORMAT_RGB888:
      return SourcePixel::kRgb888;
    case openni::PIXEL_FORMAT_GRAY8:
      return SourcePixel::kGray8;
    case openni::PIXEL_FORMAT_YUYV:
      return SourcePixel::kYuyv;
    case openni::PIXEL_FORMAT_YUV422:
      return SourcePixel::kUyvy;
    default:
      return std::nullopt;
  }
}

Library::Library() : status_{openni::OpenNI::initialize()} {}

Library::~Library() {
  openni::OpenNI::shutdown();
}

Result<void> Library::status() const {
  return check(status_, "cannot begin");
}

Result<std::unique_ptr<OpenDevice>> OpenDevice::open(const OpenNi2Options& options) {
  auto device = std::make_unique<OpenDevice>();
  const char* const uri = options.uri.empty() ? openni::ANY_DEVICE : options.uri.c_str();
  auto done = check(device->device_.open(uri),
                    options.uri.empty() ? "no device" : fmt::format("cannot open {}", options.uri))
                  .and_then([&] {
                    return device->create(device->depth_, openni::SENSOR_DEPTH, "depth", options);
                  })
                  .and_then([&] {
                    return device->create(device->color_, openni::SENSOR_COLOR, "colour", options);
                  });
  if (!done) {
    return tl::unexpected{std::move(done.error())};
  }
  device->align();
  return device;
}

void OpenDevice::pause_player() {
  depth_.video.stop();
  color_.video.stop();
  auto frame = next();
  while (frame && *frame) {  // until none has come for kLongestWait_ms
    frame = next();
  }
}

OpenDevice::~OpenDevice() {
  if (device_.isValid() && is_file()) {
    pause_player();
  }
  depth_.video.destroy();
  color_.video.destroy();
  device_.close();
}

Result<void> OpenDevice::start() {
  return check(depth_.video.start(), "depth does not start").and_then([this] {
    return check(color_.video.start(), "colour does not start");
  });
}

Result<std::optional<openni::VideoFrameRef>> OpenDevice::next() {
  const std::array<Stream*, 2> streams{&depth_, &color_};
  std::array<openni::VideoStream*, 2> waited_for{&depth_.video, &color_.video};
  int which = -1;
  const auto waited = openni::OpenNI::waitForAnyStream(waited_for.data(), waited_for.size(), &which,
                                                       kLongestWait_ms);
  if (waited == openni::STATUS_TIME_OUT) {
    return std::nullopt;
  }
  if (auto done = check(waited, "waiting for a frame"); !done) {
    return tl::unexpected{std::move(done.error())};
  }
  Stream& stream = *streams.at(static_cast<std::size_t>(which));
  openni::VideoFrameRef frame;
  if (auto read = check(stream.video.readFrame(&frame), "reading a frame"); !read) {
    return tl::unexpected{std::move(read.error())};
  }
  stream.newest_index = frame.getFrameIndex();
  return frame;
}

bool OpenDevice::at_end() const {
  const auto over = [](const Stream& stream) { return stream.newest_index >= stream.frames; };
  return is_file() && over(depth_) && over(color_);
}

Calibration OpenDevice::calibration() const {
  const openni::VideoMode mode = color_.video.getVideoMode();
  const double width = mode.getResolutionX();
  const double height = mode.getResolutionY();
  Calibration calibration;
  calibration.camera = {
      .width = mode.getResolutionX(),
      .height = mode.getResolutionY(),
      .fx =
          width / (2 * std::tan(static_cast<double>(color_.video.getHorizontalFieldOfView()) / 2)),
      .fy = height / (2 * std::tan(static_cast<double>(color_.video.getVerticalFieldOfView()) / 2)),
      .cx = (width - 1) / 2,
      .cy = (height - 1) / 2};
  const bool fine =
      depth_.video.getVideoMode().getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_100_UM;
  calibration.depth_unit_m = fine ? kTenthMillimetre_m : kMillimetre_m;
  calibration.source = fmt::format("fields of view of {}", device_.getDeviceInfo().getUri());
  return calibration;
}

Result<void> OpenDevice::create(Stream& stream, openni::SensorType type, std::string_view name,
                                const OpenNi2Options& options) {
  const auto* const sensor = device_.getSensorInfo(type);
  if (sensor == nullptr) {
    return fail(ErrorCode::kUnsupported, "OpenNI: {} has no {}", device_.getDeviceInfo().getUri(),
                name);
  }
  auto created = check(stream.video.create(device_, type), name);
  if (!created) {
    return created;
  }
  if (is_file()) {
    stream.frames = device_.getPlaybackControl()->getNumberOfFrames(stream.video);
    return {};
  }
  return choose_mode(*sensor, options, name).and_then([&](const openni::VideoMode& mode) {
    return check(stream.video.setVideoMode(mode), fmt::format("{}: {}", name, describe(mode)));
  });
}

/// What a device can do so that depth lies on colour's pixels.
void OpenDevice::align() {
  if (is_file()) {
    (void)device_.getPlaybackControl()->setRepeatEnabled(false);
    return;
  }
  for (Stream* stream : {&depth_, &color_}) {
    (void)stream->video.setMirroringEnabled(false);
  }
  const auto mode = openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
  if (!device_.isImageRegistrationModeSupported(mode) ||
      device_.setImageRegistrationMode(mode) != openni::STATUS_OK) {
    log::warning("openni2", "{} cannot register depth to colour: depth is taken as it is",
                 device_.getDeviceInfo().getUri());
  }
}

}  // namespace geoflow::drivers::openni2
