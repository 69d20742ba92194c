#include "d435i/device/device.hpp"

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/camera_facts.hpp"
#include "d435i/core/session.hpp"
#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/device/samples.hpp"
#include "d435i/pixels/registration.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers {
namespace {

using d435i::SampleMaker;
using d435i::Session;

// How long a stop may wait for the camera's next event.
constexpr Duration kLongestWait = std::chrono::milliseconds{50};

d435i::SessionOptions session_options(const D435iOptions& options) {
  const auto mode = [&](d435i::PixelCoding coding) {
    return d435i::VideoMode{coding, options.width, options.height, options.rate_hz};
  };
  return {.depth = mode(d435i::PixelCoding::kZ16),
          .color = mode(d435i::PixelCoding::kYuyv),
          .accel_hz = options.accel_hz,
          .gyro_hz = options.gyro_hz,
          .emitter = options.emitter,
          .exposure_us = options.exposure_us,
          .laser_power_mw = options.laser_power_mw};
}

ImageShape color_shape(const D435iOptions& options) {
  return {.width = options.width,
          .height = options.height,
          .format = options.color_as_gray ? PixelFormat::kGray8 : PixelFormat::kBgr8};
}

}  // namespace

class D435i::Implementation {
 public:
  Implementation(const D435iOptions& options, const d435i::OpenTransport& open,
                 std::unique_ptr<d435i::Transport> transport, const d435i::CameraFacts& facts,
                 d435i::DepthRegistration registration)
      : calibration_{d435i::calibration_of(facts)},
        firmware_{facts.versions.firmware.text()},
        maker_{std::move(registration),
               color_shape(options),
               facts.imu,
               {.domain = StampDomain::kDevice, .wrap = d435i::kClockWrap}},
        serial_{transport->link().serial},
        session_{session_options(options), open, maker_, std::move(transport), serial_} {}

  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const Duration wait = session_.step(HostClock::now(), kLongestWait);
      publish();
      if (wait > Duration::zero()) {
        std::unique_lock lock{mutex_};
        wake_.wait_for(lock, stop, wait, [] { return false; });
      }
    }
    session_.close();
    publish();
  }

  [[nodiscard]] D435iStatus status() const {
    const std::scoped_lock lock{mutex_};
    return status_;
  }
  [[nodiscard]] const Calibration& calibration() const { return calibration_; }
  [[nodiscard]] SampleMaker& maker() { return maker_; }

 private:
  /// Makes the session's account known to other threads and to the ports' health.
  void publish() {
    const auto& counters = session_.counters();
    D435iStatus status{.streaming = session_.state() == d435i::SessionState::kStreaming,
                       .trouble = session_.trouble(),
                       .firmware = firmware_,
                       .depth_frames = counters.frames[0],
                       .color_frames = counters.frames[1],
                       .damaged_frames = counters.damaged[0] + counters.damaged[1],
                       .missed_frames = maker_.missed_frames(),
                       .imu_reports = counters.imu_reports,
                       .imu_unpaired = maker_.imu_unpaired(),
                       .stamped_by_arrival = maker_.stamped_by_arrival(),
                       .stalls = counters.stalls,
                       .stream_restarts = counters.stream_restarts,
                       .camera_restarts = counters.camera_restarts,
                       .port_resets = counters.port_resets,
                       .hardware_resets = counters.hardware_resets,
                       .imu_restarts = counters.imu_restarts,
                       .losses = counters.losses,
                       .opens = counters.opens,
                       .turns = ++turns_};
    if (const auto* link = session_.link()) {
      status.transport = link->transport;
      status.place = link->place;
      status.super_speed = link->super_speed;
    } else {
      maker_.forget_counters();
    }
    if (!session_.trouble().empty()) {
      maker_.camera().set_degraded(session_.trouble());
    }
    const std::string& imu_trouble =
        session_.imu_trouble().empty() ? session_.trouble() : session_.imu_trouble();
    if (!imu_trouble.empty()) {
      maker_.imu().set_degraded(imu_trouble);
      status.trouble = imu_trouble;
    }
    const std::scoped_lock lock{mutex_};
    status_ = std::move(status);
  }

  Calibration calibration_;
  std::string firmware_;
  SampleMaker maker_;
  std::string serial_;
  Session session_;
  std::uint64_t turns_ = 0;
  mutable std::mutex mutex_;          // status_
  std::condition_variable_any wake_;  // never notified: only a stop ends its waits
  D435iStatus status_;
};

D435i::D435i(std::unique_ptr<Implementation> implementation)
    : implementation_{std::move(implementation)} {}
D435i::~D435i() = default;

const Calibration& D435i::calibration() const {
  return implementation_->calibration();
}
DepthCamera& D435i::camera() {
  return implementation_->maker().camera();
}
Imu* D435i::imu() {
  return &implementation_->maker().imu();
}
void D435i::run(const std::stop_token& stop) {
  implementation_->run(stop);
}
std::uint64_t D435i::turns() const {
  return status().turns;
}
D435iStatus D435i::status() const {
  return implementation_->status();
}

Result<std::unique_ptr<D435i>> d435i::open_device(const D435iOptions& options,
                                                  const OpenTransport& open) {
  auto transport = open(options.serial);
  if (!transport) {
    return tl::unexpected{std::move(transport.error())};
  }
  const SessionOptions wanted = session_options(options);
  const auto facts = read_facts(**transport, *wanted.depth, *wanted.color);
  if (!facts) {
    return tl::unexpected{facts.error()};
  }
  auto registration = DepthRegistration::create(facts->geometry);
  if (!registration) {
    return tl::unexpected{std::move(registration.error())};
  }
  return std::make_unique<D435i>(std::make_unique<D435i::Implementation>(
      options, open, std::move(*transport), *facts, std::move(*registration)));
}

}  // namespace geoflow::drivers
