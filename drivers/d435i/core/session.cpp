#include "d435i/core/session.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tl/expected.hpp>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/monitor.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::string_view kCategory = "d435i";

constexpr int kRungs = 4;
constexpr int kPatienceFrames = 10;  // as librealsense's endpoint watchdog
constexpr Duration kLeastPatience = milliseconds{300};
constexpr Duration kStartPatience = milliseconds{1500};
constexpr Duration kFirstBackOff = milliseconds{100};
constexpr Duration kLongestBackOff = seconds{2};
constexpr Duration kImuPatience = seconds{1};
// The kernel takes up to two seconds to turn a sensor on (hid-sensor-trigger.c waits for two report
// intervals, of which the longest is a second).
constexpr Duration kImuStartPatience = seconds{3};
constexpr Duration kLongestImuRetry = seconds{30};

constexpr std::array kStreams{VideoStream::kDepth, VideoStream::kColor};
constexpr std::array kSensors{ImuSensor::kAccelerometer, ImuSensor::kGyroscope};

std::size_t index_of(VideoStream stream) noexcept {
  return static_cast<std::size_t>(stream);
}
std::size_t index_of(ImuSensor sensor) noexcept {
  return sensor == ImuSensor::kAccelerometer ? 0 : 1;
}

std::string_view name_of(ImuSensor sensor) noexcept {
  return sensor == ImuSensor::kAccelerometer ? "accelerometer" : "gyroscope";
}

template <Field T>
std::vector<std::byte> bytes_of(T value) {
  return std::move(FieldWriter{}.put(value)).take();
}

}  // namespace

Session::Session(const SessionOptions& options, OpenTransport open, TransportSink& sink,
                 std::unique_ptr<Transport> first, std::string serial)
    : options_{options},
      open_{std::move(open)},
      sink_{sink},
      serial_{std::move(serial)},
      transport_{std::move(first)} {}

Duration Session::step(HostTime now, Duration longest) {
  if (state_ == SessionState::kAway) {
    look_for_camera(now);
    if (state_ == SessionState::kAway) {
      return std::clamp(next_look_.value_or(now) - now, Duration::zero(), longest);
    }
  }
  if (auto polled = transport_->poll(longest, *this); !polled) {
    lose(now, polled.error().message);
    return Duration::zero();
  }
  watch_video(now);
  if (transport_) {
    watch_imu(now);
  }
  return Duration::zero();
}

void Session::close() {
  if (transport_) {
    for (const VideoStream stream : kStreams) {
      transport_->stop_video(stream);
    }
    for (const ImuSensor sensor : kSensors) {
      transport_->stop_imu(sensor);
    }
  }
  transport_.reset();
  state_ = SessionState::kAway;
}

void Session::look_for_camera(HostTime now) {
  if (next_look_ && now < *next_look_) {
    return;
  }
  if (!transport_) {
    auto opened = open_(serial_);
    if (!opened) {
      lose(now, opened.error().message);
      return;
    }
    transport_ = std::move(*opened);
  }
  if (auto started = start_all(now); !started) {
    lose(now, started.error().message);
    return;
  }
  ++counters_.opens;
  state_ = SessionState::kStreaming;
  const LinkInfo& link = transport_->link();
  log::info(kCategory, "streaming from {} at {} by {}{}", link.serial, link.place, link.transport,
            link.super_speed ? "" : ", on a USB 2 link: fewer sizes and rates than on USB 3");
}

Result<void> Session::start_all(HostTime now) {
  configure();
  if (auto started = start_all_video(now); !started) {
    return started;
  }
  if (options_.imu) {
    for (const ImuSensor sensor : kSensors) {
      sensors_.at(index_of(sensor)).retry = kImuPatience;
      start_imu(sensor, now);
    }
  }
  return {};
}

Result<void> Session::start_all_video(HostTime now) {
  for (const VideoStream stream : wanted_streams()) {
    if (auto started = start_video(stream, now); !started) {
      return started;
    }
  }
  return {};
}

Result<void> Session::start_video(VideoStream stream, HostTime now) {
  streams_.at(index_of(stream)) = {.deadline = now + kStartPatience, .heard = false};
  auto started = transport_->start_video(stream, *mode_of(stream));
  return started ? started : tl::unexpected{std::move(started.error()).in(name_of(stream))};
}

/// A control that the camera refuses is said and no reason to see nothing.
void Session::configure() {
  const auto set = [this](std::string_view name, std::uint8_t selector,
                          const std::vector<std::byte>& value) {
    if (auto done = transport_->set_control(selector, value); !done) {
      log::warning(kCategory, "{} could not be set: {}", name, done.error().message);
    }
  };
  if (options_.emitter) {
    set("the projector", kEmitterSelector, bytes_of(std::uint8_t{*options_.emitter}));
  }
  if (options_.laser_power_mw) {
    set("the laser's power", kLaserPowerSelector,
        bytes_of(static_cast<std::uint16_t>(*options_.laser_power_mw)));
  }
  set("automatic exposure", kAutoExposureSelector,
      bytes_of(std::uint8_t{!options_.exposure_us.has_value()}));
  if (options_.exposure_us) {
    set("the exposure", kExposureSelector,
        bytes_of(static_cast<std::uint32_t>(*options_.exposure_us)));
  }
}

void Session::start_imu(ImuSensor sensor, HostTime now) {
  Sensor& state = sensors_.at(index_of(sensor));
  const int rate_hz = sensor == ImuSensor::kAccelerometer ? options_.accel_hz : options_.gyro_hz;
  const auto started = transport_->start_imu(sensor, rate_hz);
  state.running = false;
  state.deadline = now + std::max(kImuStartPatience, state.retry);
  if (!started) {
    log::warning(kCategory, "{}: {}", name_of(sensor), started.error().message);
    imu_trouble_ = fmt::format("{}: {}", name_of(sensor), started.error().message);
  }
}

void Session::on_frame(const RawFrame& frame) {
  const std::size_t index = index_of(frame.stream);
  ++counters_.frames.at(index);
  streams_.at(index) = {.deadline = frame.t_arrival + patience(frame.stream), .heard = true};
  if (all_video_heard() && (rung_ > 0 || back_off_ > Duration::zero())) {
    rung_ = 0;
    back_off_ = Duration::zero();
    trouble_.clear();
  }
  sink_.on_frame(frame);
}

void Session::on_imu(const RawImu& imu) {
  ++counters_.imu_reports;
  Sensor& sensor = sensors_.at(index_of(imu.reading.sensor));
  sensor = {.deadline = imu.t_arrival + kImuPatience, .retry = kImuPatience, .running = true};
  if (!imu_trouble_.empty() && std::ranges::all_of(sensors_, &Sensor::running)) {
    imu_trouble_.clear();
  }
  sink_.on_imu(imu);
}

void Session::on_damaged_frame(VideoStream stream, std::string_view why) {
  ++counters_.damaged.at(index_of(stream));
  sink_.on_damaged_frame(stream, why);
}

void Session::on_damaged_imu(std::string_view why) {
  ++counters_.imu_damaged;
  sink_.on_damaged_imu(why);
}

void Session::watch_video(HostTime now) {
  std::vector<VideoStream> stalled;
  for (const VideoStream stream : wanted_streams()) {
    if (now > streams_.at(index_of(stream)).deadline) {
      ++counters_.stalls;
      stalled.push_back(stream);
    }
  }
  if (!stalled.empty()) {
    climb(stalled, now);
  }
}

void Session::climb(const std::vector<VideoStream>& stalled, HostTime now) {
  trouble_ = stalled.size() == kVideoStreams
                 ? std::string{"depth and colour fell silent"}
                 : fmt::format("{} fell silent", name_of(stalled.front()));
  log::warning(kCategory, "{}; remedy {} of {}", trouble_, std::min(rung_ + 1, kRungs), kRungs);
  Result<void> done;
  switch (rung_++) {
    case 0:
      for (const VideoStream stream : stalled) {
        ++counters_.stream_restarts;
        transport_->stop_video(stream);
        done = done ? start_video(stream, now) : done;
      }
      break;
    case 1:
      ++counters_.camera_restarts;
      for (const VideoStream stream : kStreams) {
        transport_->stop_video(stream);
      }
      done = start_all_video(now);
      break;
    case 2:
      ++counters_.port_resets;
      (void)transport_->reset();  // whether it did, the next look shows
      lose(now, "its USB port was reset");
      return;
    default:
      ++counters_.hardware_resets;
      (void)send_hardware_reset(*transport_);
      lose(now, "it was told to reset itself");
      return;
  }
  if (!done) {
    lose(now, done.error().message);
  }
}

void Session::watch_imu(HostTime now) {
  for (const ImuSensor sensor : kSensors) {
    Sensor& state = sensors_.at(index_of(sensor));
    if (!options_.imu || now <= state.deadline) {
      continue;
    }
    ++counters_.imu_restarts;
    imu_trouble_ = fmt::format("the {} is silent", name_of(sensor));
    log::warning(kCategory, "{}: it is started again", imu_trouble_);
    transport_->stop_imu(sensor);
    state.retry = std::min(2 * state.retry, kLongestImuRetry);
    start_imu(sensor, now);
  }
}

void Session::lose(HostTime now, const std::string& why) {
  if (state_ == SessionState::kStreaming) {
    ++counters_.losses;
    log::warning(kCategory, "the camera is lost: {}", why);
  }
  trouble_ = why;
  state_ = SessionState::kAway;
  transport_.reset();
  // The first look comes at once: a camera that was only reset may be back already.
  next_look_ = back_off_ == Duration::zero() ? now : now + back_off_;
  back_off_ = std::clamp(2 * back_off_, kFirstBackOff, kLongestBackOff);
}

const std::optional<VideoMode>& Session::mode_of(VideoStream stream) const noexcept {
  return stream == VideoStream::kDepth ? options_.depth : options_.color;
}

std::vector<VideoStream> Session::wanted_streams() const {
  std::vector<VideoStream> wanted;
  std::ranges::copy_if(kStreams, std::back_inserter(wanted),
                       [this](VideoStream stream) { return mode_of(stream).has_value(); });
  return wanted;
}

bool Session::all_video_heard() const {
  return std::ranges::all_of(kStreams, [this](VideoStream stream) {
    return !mode_of(stream) || streams_.at(index_of(stream)).heard;
  });
}

Duration Session::patience(VideoStream stream) const noexcept {
  const Duration interval = Duration{seconds{1}} / std::max(mode_of(stream)->rate_hz, 1);
  return std::max(kPatienceFrames * interval, kLeastPatience);
}

}  // namespace geoflow::drivers::d435i
