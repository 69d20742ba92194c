#include "src/opener.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include <pthread.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"

namespace geoflow::daemon {
namespace {

constexpr Duration kFirstPause = std::chrono::milliseconds{100};
constexpr Duration kLongestPause = std::chrono::seconds{2};
constexpr const char* kName = "open";

}  // namespace

Opener::Opener(const Config& config, timesync::Doorbell& bell, timesync::Doorbell stop_bell)
    : config_{config},
      bell_{bell},
      stop_bell_{std::move(stop_bell)},
      thread_{[this](const std::stop_token& stop) {
        ::pthread_setname_np(::pthread_self(), kName);
        const std::stop_callback wake{stop, [this] { stop_bell_.stop(); }};
        open(stop);
      }} {}

Opener::~Opener() = default;

void Opener::open(const std::stop_token& stop) {
  const bool is_device = !config_.source.camera.empty();
  Duration pause = kFirstPause;
  std::string said;
  while (!stop.stop_requested()) {
    auto run = open_run(config_);
    if (run || !is_device) {
      outcome_.emplace(std::move(run));
      done_.store(true, std::memory_order_release);
      bell_.ring();
      return;
    }
    if (run.error().message != said) {
      said = run.error().message;
      log::warning("source", "{}; it is waited for", said);
      reports_.store(said);
      bell_.ring();
    }
    attempts_.fetch_add(1, std::memory_order_relaxed);
    waiting_.store(true, std::memory_order_release);
    (void)stop_bell_.wait(pause);
    waiting_.store(false, std::memory_order_release);
    pause = std::min(2 * pause, kLongestPause);
  }
}

std::optional<Result<Run>> Opener::take() {
  if (!done_.load(std::memory_order_acquire)) {
    return std::nullopt;
  }
  return std::exchange(outcome_, std::nullopt);
}

const std::string& Opener::trouble() {
  if (auto report = reports_.take_new()) {
    trouble_ = *std::move(report);
  }
  return trouble_;
}

ThreadActivity Opener::activity() const {
  return {.name = kName,
          .turns = attempts_.load(std::memory_order_relaxed),
          .idle = waiting_.load(std::memory_order_acquire) || done_.load(std::memory_order_acquire),
          .long_work = true};
}

}  // namespace geoflow::daemon
