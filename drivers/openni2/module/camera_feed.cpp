#include "openni2/module/camera_feed.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/camera_facts.hpp"
#include "d435i/core/session.hpp"
#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::openni2 {
namespace {

using d435i::RawFrame;
using d435i::VideoMode;
using d435i::VideoStream;

// How long a stop may wait for the camera's next event.
constexpr Duration kLongestWait = std::chrono::milliseconds{50};

// Streams of one camera are not further apart.
constexpr std::uint32_t kLargestLag_us = 1'000'000;
// Half of what the count can say: more is a step backwards.
constexpr std::uint32_t kLargestStep_us = 1U << 31U;

std::size_t index_of(VideoStream stream) noexcept {
  return static_cast<std::size_t>(stream);
}

}  // namespace

std::uint64_t LongClock::extend(std::uint32_t count_us) noexcept {
  if (!newest_count_us_) {
    newest_count_us_ = count_us;
    newest_us_ = count_us;
    return newest_us_;
  }
  const std::uint32_t lag_us = *newest_count_us_ - count_us;
  if (lag_us <= kLargestLag_us) {
    return newest_us_ - std::min<std::uint64_t>(lag_us, newest_us_);
  }
  const std::uint32_t step_us = count_us - *newest_count_us_;
  newest_us_ += step_us <= kLargestStep_us ? step_us : 0;
  newest_count_us_ = count_us;
  return newest_us_;
}

Result<std::unique_ptr<CameraFeed>> CameraFeed::open(const std::string& serial,
                                                     d435i::OpenTransport opener) {
  const auto transport = opener(serial);
  if (!transport) {
    return tl::unexpected{transport.error()};
  }
  auto tables = d435i::read_tables(**transport);
  if (!tables) {
    return tl::unexpected{std::move(tables.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  return std::unique_ptr<CameraFeed>{new CameraFeed{(*transport)->link().serial, std::move(opener),
                                                    std::move(*tables),
                                                    (*transport)->link().modes}};
}

CameraFeed::CameraFeed(std::string serial, d435i::OpenTransport opener, d435i::CameraTables tables,
                       std::vector<VideoMode> modes)
    : serial_{std::move(serial)},
      opener_{std::move(opener)},
      tables_{std::move(tables)},
      modes_{std::move(modes)} {}

CameraFeed::~CameraFeed() {
  halt();
}

Result<void> CameraFeed::start(VideoStream stream, const VideoMode& mode, Handler handler) {
  const std::scoped_lock lock{changes_};
  halt();
  wanted_.at(index_of(stream)) = Wanted{.mode = mode, .handler = std::move(handler)};
  auto resumed = resume();
  if (!resumed) {
    wanted_.at(index_of(stream)).reset();
    if (const auto others = resume(); !others) {
      log::warning("openni2", "{}", others.error().message);
    }
  }
  return resumed;
}

void CameraFeed::stop(VideoStream stream) {
  const std::scoped_lock lock{changes_};
  if (!wanted_.at(index_of(stream))) {
    return;
  }
  halt();
  wanted_.at(index_of(stream)).reset();
  if (const auto resumed = resume(); !resumed) {
    log::warning("openni2", "{}", resumed.error().message);
  }
}

void CameraFeed::halt() {
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
  }
  session_.reset();
}

Result<void> CameraFeed::resume() {
  const auto& [depth, color] = wanted_;
  if (!depth && !color) {
    return {};
  }
  const auto mode_of = [](const std::optional<Wanted>& wanted) {
    return wanted ? std::optional{wanted->mode} : std::nullopt;
  };
  auto transport = opener_(serial_);
  if (!transport) {
    return tl::unexpected{std::move(transport.error())};
  }
  session_ = std::make_unique<d435i::Session>(
      d435i::SessionOptions{.depth = mode_of(depth), .color = mode_of(color), .imu = false},
      opener_, static_cast<d435i::TransportSink&>(*this), std::move(*transport), serial_);
  thread_ = std::jthread{[this](const std::stop_token& stop) { run(stop); }};
  return {};
}

void CameraFeed::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const Duration wait = session_->step(HostClock::now(), kLongestWait);
    if (wait > Duration::zero()) {
      std::unique_lock lock{waiting_};
      wake_.wait_for(lock, stop, wait, [] { return false; });
    }
  }
  session_->close();
}

void CameraFeed::on_frame(const RawFrame& frame) {
  auto& wanted = wanted_.at(index_of(frame.stream));
  if (!wanted) {
    return;
  }
  std::optional<std::uint32_t> device_us;
  if (const auto stamp = d435i::read_frame_stamp(frame.header)) {
    device_us = stamp->t_us;
  }
  wanted->handler(frame, clock_.extend(wanted->stamps.stamp(device_us, frame.t_arrival)));
}

void CameraFeed::on_damaged_frame(VideoStream stream, std::string_view why) {
  log::debug("openni2", "a {} frame is lost: {}", d435i::name_of(stream), why);
}

}  // namespace geoflow::drivers::openni2
