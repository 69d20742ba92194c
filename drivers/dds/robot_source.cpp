#include "dds/robot_source.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include <pthread.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/channel.hpp"
#include "dds/message_filter.hpp"

namespace geoflow::drivers::dds {
namespace {

/// How often the stream is looked at while nothing comes: what is wrong is seen that much later.
constexpr Duration kLook = std::chrono::milliseconds{10};
constexpr Duration kFirstPause = std::chrono::milliseconds{50};
constexpr Duration kLongestPause = std::chrono::seconds{1};

constexpr StampInfo kStamps{.domain = StampDomain::kDevice, .wrap = MessageFilter::kTickPeriod};

}  // namespace

RobotSource::RobotSource(std::unique_ptr<Channel> channel, std::string where)
    : channel_{std::move(channel)}, filter_{std::move(where)}, legs_{kStamps}, imu_{kStamps} {
  thread_ = std::jthread{[this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "dds");
    const std::stop_callback wake{stop, [this] { channel_->wake(); }};
    run(stop);
  }};
}

RobotSource::~RobotSource() {
  thread_.request_stop();
  thread_.join();
}

void RobotSource::run(const std::stop_token& stop) {
  Duration pause = kFirstPause;
  while (!stop.stop_requested()) {
    if (!open_ && !open(pause)) {
      channel_->pause(pause);
      pause = std::min(2 * pause, kLongestPause);
      continue;
    }
    if (auto read = channel_->read(*this, kLook); !read) {
      filter_.failed(read.error());
      open_ = false;
    }
    report(HostClock::now());
  }
}

bool RobotSource::open(Duration& pause) {
  const auto opened = channel_->open();
  const HostTime now = HostClock::now();
  open_ = opened.has_value();
  if (open_) {
    filter_.opened(now);
    pause = kFirstPause;
  } else {
    filter_.failed(opened.error());
    report(now);
  }
  return open_;
}

void RobotSource::on_message(std::span<const std::byte> cdr, HostTime t_arrival) {
  if (const auto sample = filter_.take(cdr, t_arrival)) {
    legs_.deliver([&](LegSink& sink) { sink.on_legs(sample->legs); });
    imu_.deliver([&](ImuSink& sink) { sink.on_imu(sample->imu); });
  }
}

void RobotSource::report(HostTime now) {
  const MessageFilter::Report found = filter_.assess(now, channel_->writers());
  if (found.reason != logged_) {
    if (found.reason.empty()) {
      log::info("dds", "the robot's messages come as they should");
    } else {
      log::warning("dds", "{}", found.reason);
    }
    logged_ = found.reason;
  }
  const MessageCounters& counters = filter_.counters();
  const std::uint64_t rejected = counters.malformed + counters.damaged + counters.duplicates;
  legs_.report(found.state, found.reason, rejected);
  imu_.report(found.state, found.reason, rejected);
}

}  // namespace geoflow::drivers::dds

namespace geoflow::drivers {

Result<std::unique_ptr<DdsRobot>> DdsRobot::open(const DdsRobotOptions& options) {
  const dds::Address address{.topic = options.topic,
                             .domain = static_cast<std::uint32_t>(options.domain),
                             .interface = options.interface};
  auto channel = dds::make_subscriber(address);
  if (!channel) {
    return tl::unexpected{std::move(channel.error())};
  }
  return std::make_unique<dds::RobotSource>(*std::move(channel), address.to_string());
}

}  // namespace geoflow::drivers
