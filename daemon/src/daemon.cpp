#include "geoflow/daemon/daemon.hpp"

#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/epoll.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/version.hpp"
#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"

#include "config/reload.hpp"
#include "map/map_cloud.hpp"
#include "map/map_commands.hpp"
#include "map/map_job.hpp"
#include "protocol/control_request.hpp"
#include "server/control_connection.hpp"
#include "server/event_loop.hpp"
#include "service/given_sockets.hpp"
#include "service/journal.hpp"
#include "service/memory_lock.hpp"
#include "service/notify.hpp"
#include "service/reporter.hpp"
#include "service/source_watch.hpp"
#include "service/status_line.hpp"
#include "src/outlets.hpp"
#include "src/signal_watch.hpp"
#include "src/worker.hpp"

namespace geoflow::daemon {
namespace {

constexpr auto kHousekeepingPeriod = std::chrono::milliseconds{100};
constexpr auto kLastWords = std::chrono::seconds{1};  // that clients get to read the last pose

/// What of a configuration can be judged before anything is opened.
Result<void> check(const Config& config) {
  return check_source(config).and_then(
      [&] { return drivers::RosPublisher::check(config.ros.publisher); });
}

/// The daemon's objects and how they are wired. All on one thread, the loop's.
class Daemon {
 public:
  Daemon(const Config& config, std::function<Result<Config>()> read_config,
         std::unique_ptr<EventLoop> loop, timesync::Doorbell bell)
      : config_{config},
        read_config_{std::move(read_config)},
        loop_{std::move(loop)},
        bell_{std::move(bell)} {}

  Result<void> start(service::GivenSockets given) {
    return watch_signals()
        .and_then([&] { return open_outlets(std::move(given)); })
        .and_then([this] { return start_worker(); })
        .and_then([this] {
          return loop_->add(bell_.fd(), EPOLLIN, [this](std::uint32_t /*events*/) { on_bell(); });
        })
        .and_then(
            [this] { return loop_->add_timer(kHousekeepingPeriod, [this] { keep_house(); }); })
        .map([this] {
          // A device may come at any time; that a recording is there, is part of being ready.
          if (!config_.source.camera.empty()) {
            reporter_.ready();
          }
        });
  }

  Result<void> run() { return loop_->run(); }

 private:
  Result<void> watch_signals() {
    // A file that grows over a limit is a map that is not saved, not the end.
    (void)::signal(SIGXFSZ, SIG_IGN);
    auto watch = SignalWatch::create(*loop_, {SIGINT, SIGTERM, SIGHUP},
                                     [this](int signal) { on_signal(signal); });
    return std::move(watch).map([this](auto made) { signals_ = std::move(made); });
  }

  Result<void> open_outlets(service::GivenSockets given) {
    auto outlets =
        Outlets::open(*loop_, config_, Worker::clock_flags(config_.source), std::move(given),
                      {.status = [this] { return status(); },
                       .config = [this] { return configuration(); },
                       .change = [this](const ChangeRequest& request,
                                        const Asker& asker) { begin(request, asker); }});
    return std::move(outlets).map([this](auto opened) { outlets_ = std::move(opened); });
  }

  Result<void> start_worker() {
    auto worker = Worker::start(config_, bell_, resets_);
    return std::move(worker).map([this](auto made) { worker_ = std::move(made); });
  }

  void on_bell() {
    bell_.clear();
    if (!leaving_) {
      take_source();
    }
    map_.turn(worker_->map(), running_.map.save_interval, HostClock::now());
    const bool ended = worker_->ended();  // before the pose is taken, which then is the last
    if (const auto pose = worker_->take_pose()) {
      resets_ = pose->reset_counter;
      newest_ = *pose;
      outlets_->publish(*pose);
    }
    if (const auto pose = worker_->take_propagated()) {
      outlets_->publish_propagated(*pose);
    }
    if (const auto images = worker_->take_images()) {
      outlets_->publish(*images, worker_->calibration());
    }
    if (ended && !leaving_) {
      running_.source.loop ? restart() : leave(GEOFLOW_END_REPLAYED);
    }
  }

  /// Starts the run when its source is open.
  void take_source() {
    auto proceeded = worker_->proceed();
    if (!proceeded) {
      end_with(std::move(proceeded.error()));
    } else if (worker_->is_open()) {
      reporter_.ready();
    }
  }

  void on_signal(int signal) {
    if (signal == SIGHUP) {
      (void)reload();
      return;
    }
    log::info("daemon", "stopping on signal {}", signal);
    reporter_.stopping("stopping");
    worker_->stop();
    leave(GEOFLOW_END_STOPPED);
  }

  /// What a client asked for and may have.
  void begin(const ChangeRequest& request, const Asker& asker) {
    const HostTime now = HostClock::now();
    switch (request.change) {
      case Change::kReload:
        outlets_->conclude(asker, reload());
        return;
      case Change::kSaveMap:
        map_.ask({.job = MapJob::kSave}, asker, now);
        break;
      case Change::kResetMap:
        map_.ask({.job = MapJob::kForget}, asker, now);
        break;
      case Change::kReset:
        map_.ask({.job = MapJob::kRestart}, asker, now);
        break;
      case Change::kLoadMap:
        map_.ask({.job = MapJob::kLoad, .file = request.file}, asker, now);
        break;
    }
    map_.turn(worker_->map(), running_.map.save_interval, now);
  }

  /// Reads the configuration again; what is wrong with it, or what has become of it.
  Result<nlohmann::json> reload() {
    reporter_.reloading();
    auto reloaded = read_config_().and_then([this](const Config& read) {
      return check(read).map([&] { return take_over(read, config_, running_); });
    });
    reporter_.reloaded();
    if (!reloaded) {
      log::error("daemon", "not reloaded: {}", reloaded.error().message);
      return tl::unexpected{std::move(reloaded.error())};
    }
    outlets_->set_limits(running_.socket);
    log::info("daemon", "reloaded; changed: {}; at the next start only: {}",
              fmt::join(reloaded->changed, ", "), fmt::join(reloaded->restart, ", "));
    return nlohmann::json{{"changed", reloaded->changed}, {"restart", reloaded->restart}};
  }

  void restart() {
    ++resets_;
    map_.hold();
    worker_.reset();
    auto started = start_worker();
    if (!started) {
      end_with(std::move(started.error()));
    }
  }

  void end_with(Error failure) {
    failure_ = std::move(failure);
    loop_->stop();
  }

  /// Says goodbye and ends once every client has heard it, or after kLastWords.
  void leave(geoflow_end_reason reason) {
    leaving_ = HostClock::now();
    map_.abandon("the daemon ends");
    outlets_->finish(reason);
    keep_house();
  }

  void keep_house() {
    outlets_->check_timeouts();
    if (leaving_ && (outlets_->is_done() || HostClock::now() - *leaving_ > kLastWords)) {
      loop_->stop();
    }
    if (!leaving_ && worker_) {
      pass_on_wishes();
      report();
    }
  }

  /// Images and clouds are made while a client wants them.
  void pass_on_wishes() {
    const std::uint32_t wanted = outlets_->wanted_frames();
    worker_->want_images((wanted & (GEOFLOW_WANT_COLOR | GEOFLOW_WANT_DEPTH)) != 0);
    map_.want_to_see((wanted & GEOFLOW_WANT_CLOUD) != 0);
  }

  /// Tells the service manager.
  void report() {
    const HostTime now = HostClock::now();
    map_.turn(worker_->map(), running_.map.save_interval, now);
    reporter_.watch(worker_->threads(), now);
    sources_.look(worker_->sources(), now);
    if (reporter_.is_due(now)) {
      service::Observation seen{.pose = newest_,
                                .frames = worker_->frames(),
                                .sources = sources_.sources(),
                                .trouble = worker_->trouble()};
      if (seen.trouble.empty() && !map_.trouble().empty()) {
        seen.trouble = "the map is not saved: " + map_.trouble();
      }
      if (seen.trouble.empty() && !outlets_->trouble().empty()) {
        seen.trouble = "ROS 2 is not told: " + outlets_->trouble();
      }
      reporter_.tell(seen, now);
      outlets_->report(seen, reporter_.told());
    }
  }

  [[nodiscard]] nlohmann::json status() {
    nlohmann::json status = worker_ ? worker_->status() : nlohmann::json::object();
    if (worker_) {
      sources_.look(worker_->sources(), HostClock::now());
    }
    status["health"] = service::to_json(sources_.sources());
    status["version"] = std::string{version()};
    status["pid"] = ::getpid();
    status["uptime_s"] = to_seconds(HostClock::now() - began_);
    status["peak_memory_mib"] = peak_memory_mib();
    outlets_->add_status(status);
    status["summary"] = reporter_.told();
    status["pose"] = newest_ ? pose_to_json(*newest_) : nlohmann::json{};
    status["map"] = map_.status(HostClock::now());
    status["map"]["file"] = config_.map.file.string();
    return status;
  }

  [[nodiscard]] nlohmann::json configuration() const {
    nlohmann::json values = nlohmann::json::object();
    for (const ConfigValue& key : list_keys(running_)) {
      values[key.key] = key.value;
    }
    return values;
  }

 public:
  /// What ended the loop, if it was a failure.
  [[nodiscard]] const std::optional<Error>& failure() const noexcept { return failure_; }

 private:
  const Config& config_;  // as it was started
  Config running_{config_};
  std::function<Result<Config>()> read_config_;
  HostTime began_ = HostClock::now();
  std::unique_ptr<EventLoop> loop_;
  timesync::Doorbell bell_;  // from the worker's threads
  std::unique_ptr<SignalWatch> signals_;
  std::unique_ptr<Outlets> outlets_;
  MapCommands map_{[this](const Asker& asker, const Result<nlohmann::json>& outcome) {
                     outlets_->conclude(asker, outcome);
                   },
                   [this](const MapCloud& cloud) { outlets_->publish(cloud); }};
  std::uint32_t resets_ = 0;
  std::unique_ptr<Worker> worker_;
  std::optional<geoflow_pose> newest_;
  service::SourceWatch sources_;
  service::Reporter reporter_{service::watchdog_period()};
  std::optional<HostTime> leaving_;
  std::optional<Error> failure_;
};

}  // namespace

Result<ExitCode> run_daemon(const Config& config, std::function<Result<Config>()> read_config) {
  service::log_to_journal();
  auto given = service::take_given_sockets();
  if (!given) {
    return tl::unexpected{std::move(given.error())};
  }
  auto loop = EventLoop::create();
  if (!loop) {
    return tl::unexpected{std::move(loop.error())};
  }
  auto bell = timesync::Doorbell::create();
  if (!bell) {
    return tl::unexpected{std::move(bell.error())};
  }
  if (config.pipeline.lock_memory) {
    if (const auto locked = service::lock_memory(); !locked) {
      log::warning("daemon", "memory is not locked: {}", locked.error().message);
    }
  }
  Daemon daemon{config, std::move(read_config), std::move(*loop), std::move(*bell)};
  auto done = daemon.start(std::move(*given)).and_then([&] { return daemon.run(); });
  if (!done) {
    return tl::unexpected{std::move(done.error())};
  }
  if (const std::optional<Error>& failure = daemon.failure()) {
    return tl::unexpected{*failure};
  }
  return ExitCode::kOk;
}

}  // namespace geoflow::daemon
