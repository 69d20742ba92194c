#include "service/notify.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <system_error>

#include <fmt/core.h>
#include <systemd/sd-daemon.h>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon::service {
namespace {

void send(const std::string& lines) {
  static std::atomic<bool> said{false};
  const int sent = ::sd_notify(0, lines.c_str());
  if (sent < 0 && !said.exchange(true)) {
    log::warning("service", "the service manager cannot be told: $NOTIFY_SOCKET: {}",
                 std::generic_category().message(-sent));
  }
}

}  // namespace

void notify_ready(const std::string& status) {
  send(fmt::format("READY=1\nSTATUS={}", status));
}

void notify_status(const std::string& status) {
  send(fmt::format("STATUS={}", status));
}

void notify_reloading() {
  send("RELOADING=1");
}

void notify_stopping(const std::string& status) {
  send(fmt::format("STOPPING=1\nSTATUS={}", status));
}

void notify_watchdog() {
  send("WATCHDOG=1");
}

Duration watchdog_period() {
  std::uint64_t period_us = 0;
  const int enabled = ::sd_watchdog_enabled(0, &period_us);
  if (enabled < 0) {
    log::warning("service", "there is no watchdog: $WATCHDOG_USEC, $WATCHDOG_PID: {}",
                 std::generic_category().message(-enabled));
  }
  return enabled > 0 ? Duration{std::chrono::microseconds{period_us}} : Duration::zero();
}

}  // namespace geoflow::daemon::service
