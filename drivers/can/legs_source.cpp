#include "can/legs_source.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <fstream>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <pthread.h>
#include <tl/expected.hpp>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "can/candump.hpp"
#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/link_monitor.hpp"
#include "can/snapshot.hpp"

namespace geoflow::drivers::can {
namespace {

/// How often the bus is looked at while nothing comes: what is wrong is seen that much later.
constexpr Duration kLook = std::chrono::milliseconds{10};
constexpr Duration kFirstPause = std::chrono::milliseconds{50};
constexpr Duration kLongestPause = std::chrono::seconds{1};

}  // namespace

LegsSource::LegsSource(LegDictionary dictionary, std::unique_ptr<Channel> channel,
                       std::vector<std::string> interfaces, std::ofstream log)
    : dictionary_{std::move(dictionary)},
      channel_{std::move(channel)},
      interfaces_{std::move(interfaces)},
      assembler_{dictionary_},
      monitor_{dictionary_, interfaces_},
      log_{std::move(log)} {}

Result<void> LegsSource::start(LegSink& sink) {
  if (thread_.joinable()) {
    return fail(ErrorCode::kUnavailable, "the legs' bus is read already");
  }
  thread_ = std::jthread{[this, &sink](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "can");
    const std::stop_callback wake{stop, [this] { channel_->wake(); }};
    run(stop, sink);
  }};
  return {};
}

void LegsSource::stop_thread() {
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
    const std::scoped_lock lock{mutex_};
    health_.state = SourceState::kStopped;
    health_.reason.clear();
  }
}

SourceHealth LegsSource::health() const {
  const std::scoped_lock lock{mutex_};
  return health_;
}

void LegsSource::run(const std::stop_token& stop, LegSink& sink) {
  Duration pause = kFirstPause;
  while (!stop.stop_requested()) {
    if (open_ || open(pause)) {
      read(sink);
    } else {
      channel_->pause(pause);
      pause = std::min(2 * pause, kLongestPause);
    }
  }
}

bool LegsSource::open(Duration& pause) {
  const auto opened = channel_->open();
  const HostTime now = HostClock::now();
  open_ = opened.has_value();
  if (open_) {
    monitor_.opened(now);
    listening_ = Listen::kToKnown;
    pause = kFirstPause;
  } else {
    monitor_.failed(opened.error());
    report(now);
  }
  return open_;
}

void LegsSource::read(LegSink& sink) {
  frames_.clear();
  const auto read = channel_->read(frames_, kLook);
  for (const Received& received : frames_) {
    if (log_.is_open()) {
      const auto bus = std::min<std::size_t>(received.bus, interfaces_.size() - 1);
      log_ << format_log_line(received.t_arrival.time_since_epoch(), interfaces_[bus],
                              received.frame)
           << '\n';
    }
    monitor_.on_frame(received, assembler_.push(received));
    deliver(sink, received.t_arrival);
  }
  const HostTime now = HostClock::now();
  deliver(sink, now);
  monitor_.on_overflow(channel_->overflowed(), now);
  if (!read) {
    monitor_.failed(read.error());
    open_ = false;
  }
  const Listen wanted = monitor_.is_silent(now) ? Listen::kToAll : Listen::kToKnown;
  if (open_ && wanted != listening_) {
    channel_->listen(wanted);
    listening_ = wanted;
  }
  report(now);
}

void LegsSource::deliver(LegSink& sink, HostTime now) {
  while (const auto snapshot = assembler_.pop(now)) {
    sink.on_legs(*snapshot);
  }
}

void LegsSource::report(HostTime now) {
  LinkReport found = monitor_.assess(now, assembler_);
  if (found.trouble != logged_) {
    if (found.trouble == LinkTrouble::kNone) {
      log::info("can", "the legs' bus is well");
    } else {
      log::warning("can", "{}", found.reason);
    }
    logged_ = found.trouble;
  }
  const AssemblyCounters& counters = assembler_.counters();
  const std::scoped_lock lock{mutex_};
  health_.state = found.state;
  health_.reason = std::move(found.reason);
  health_.delivered = counters.snapshots;
  health_.rejected = counters.too_short + counters.implausible + counters.duplicate +
                     counters.late + counters.out_of_step + counters.unattributed;
  health_.dropped = channel_->overflowed();
}

}  // namespace geoflow::drivers::can
