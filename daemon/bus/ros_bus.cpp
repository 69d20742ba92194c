#include "bus/ros_bus.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>

#include <pthread.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"

#include "bus/ros_messages.hpp"
#include "server/token_bucket.hpp"
#include "service/status_line.hpp"

namespace geoflow::daemon::bus {
namespace {

constexpr Duration kFirstPause = std::chrono::milliseconds{100};
constexpr Duration kLongestPause = std::chrono::seconds{5};

}  // namespace

RosBus::RosBus(const RosConfig& config, timesync::Doorbell bell, timesync::Doorbell stop_bell)
    : config_{config},
      rate_{config.rate_hz},
      bell_{std::move(bell)},
      stop_bell_{std::move(stop_bell)},
      thread_{[this](const std::stop_token& stop) {
        ::pthread_setname_np(::pthread_self(), "ros");
        const std::stop_callback wake{stop, [this] {
                                        bell_.stop();
                                        stop_bell_.stop();
                                      }};
        run(stop);
      }} {}

RosBus::~RosBus() = default;

Result<std::unique_ptr<RosBus>> RosBus::start(const RosConfig& config) {
  if (auto checked = drivers::RosPublisher::check(config.publisher); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  auto bell = timesync::Doorbell::create();
  auto stop_bell = timesync::Doorbell::create();
  if (!bell || !stop_bell) {
    return tl::unexpected{std::move(bell ? stop_bell.error() : bell.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  return std::unique_ptr<RosBus>{new RosBus{config, std::move(*bell), std::move(*stop_bell)}};
}

void RosBus::publish(const geoflow_pose& pose) {
  if (pose.reset_counter != resets_) {  // perhaps another run, whose time may begin anew
    resets_ = pose.reset_counter;
    newest_capture_ns_ = std::numeric_limits<std::int64_t>::min();
    rate_ = RateLimit{config_.rate_hz};
  }
  if (pose.t_capture_ns <= newest_capture_ns_) {
    return;
  }
  const auto message = make_ros_pose(pose, config_);
  if (!message || !rate_.due(HostTime{Duration{pose.t_capture_ns}})) {
    return;
  }
  newest_capture_ns_ = pose.t_capture_ns;
  poses_.store(*message);
  bell_.ring();
}

void RosBus::report(const service::Observation& seen, const std::string& summary) {
  diagnostics_.store(make_diagnostics(seen, summary));
  bell_.ring();
}

const std::string& RosBus::trouble() {
  if (auto news = troubles_.take_new()) {
    trouble_ = *std::move(news);
  }
  return trouble_;
}

void RosBus::run(const std::stop_token& stop) {
  Duration pause = kFirstPause;
  while (!stop.stop_requested()) {
    auto publisher = drivers::RosPublisher::open(config_.publisher);
    if (publisher) {
      pause = kFirstPause;
    }
    const auto ended = publisher ? talk(**publisher, stop)
                                 : Result<void>{tl::unexpected{std::move(publisher.error())}};
    readers_.store(0, std::memory_order_relaxed);
    if (!ended) {
      say_trouble(ended.error().message);
      (void)stop_bell_.wait(pause);
      pause = std::min(2 * pause, kLongestPause);
    }
  }
}

/// Until it is to stop, or DDS fails.
Result<void> RosBus::talk(drivers::RosPublisher& publisher, const std::stop_token& stop) {
  log::info("ros", "on the network");
  say_trouble("");
  while (!stop.stop_requested()) {
    (void)bell_.wait();
    if (auto said = say_newest(publisher); !said) {
      return said;
    }
    readers_.store(publisher.readers(), std::memory_order_relaxed);
  }
  return {};
}

Result<void> RosBus::say_newest(drivers::RosPublisher& publisher) {
  if (const auto pose = poses_.take_new()) {
    if (auto written = publisher.write(*pose); !written) {
      return written;
    }
    published_.fetch_add(1, std::memory_order_relaxed);
  }
  if (const auto diagnostics = diagnostics_.take_new()) {
    const Duration now = HostClock::now().time_since_epoch() + realtime_minus_monotonic();
    return publisher.write(*diagnostics, now);
  }
  return {};
}

void RosBus::say_trouble(const std::string& sentence) {
  if (sentence == said_) {
    return;
  }
  if (!sentence.empty()) {
    log::warning("ros", "{}; it is tried again", sentence);
  }
  troubles_.store(sentence);
  said_ = sentence;
}

}  // namespace geoflow::daemon::bus
