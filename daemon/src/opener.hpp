#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/latest.hpp"

namespace geoflow::daemon {

/// Opens the configured source on a thread of its own, since a recording, a camera's firmware and a
/// large map take their time. A camera that is not there is tried again and again, at first soon
/// and then every two seconds: it may be switched on or plugged in later. All calls from the thread
/// that made it.
class Opener {
 public:
  /// Rings `bell` when there is an outcome. `config` and both bells must outlive it; `stop_bell` is
  /// its own.
  Opener(const Config& config, timesync::Doorbell& bell, timesync::Doorbell stop_bell);
  Opener(const Opener&) = delete;
  Opener& operator=(const Opener&) = delete;
  /// Ends the thread, at the latest when the attempt under way is over (about a second).
  ~Opener();

  /// The source or, of a recording, why it cannot be opened; nothing while that is not known.
  [[nodiscard]] std::optional<Result<Run>> take();
  /// Why there is no camera yet; empty where nothing is known to be wrong.
  [[nodiscard]] const std::string& trouble();
  [[nodiscard]] ThreadActivity activity() const;

 private:
  void open(const std::stop_token& stop);

  const Config& config_;
  timesync::Doorbell& bell_;
  timesync::Doorbell stop_bell_;
  std::optional<Result<Run>> outcome_;     // the thread's until done_
  timesync::Latest<std::string> reports_;  // from the thread
  std::string trouble_;
  std::atomic<std::uint64_t> attempts_{0};
  std::atomic<bool> waiting_{false};
  std::atomic<bool> done_{false};
  std::jthread thread_;
};

}  // namespace geoflow::daemon
