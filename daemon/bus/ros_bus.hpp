#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/timesync/latest.hpp"

#include "server/token_bucket.hpp"
#include "service/status_line.hpp"

namespace geoflow::daemon::bus {

/// Tells ROS 2 machines the newest pose and health, on a thread of its own (`ros`): DDS may block
/// or fail there, and nobody waits for it. What cannot be joined is tried again, with growing
/// pauses. All calls from the thread that made it; none blocks.
class RosBus {
 public:
  /// `config` must outlive it. Errors: those of RosPublisher::check().
  [[nodiscard]] static Result<std::unique_ptr<RosBus>> start(const RosConfig& config);
  RosBus(const RosBus&) = delete;
  RosBus& operator=(const RosBus&) = delete;
  ~RosBus();

  /// Says a pose if it is newer than the one before, has a pose at all, and is due by the
  /// configured rate.
  void publish(const geoflow_pose& pose);
  /// Says how the daemon is. `summary`: the status line.
  void report(const service::Observation& seen, const std::string& summary);

  /// Why it is not on the network; empty while it is, and before the first try.
  [[nodiscard]] const std::string& trouble();
  /// Poses said so far.
  [[nodiscard]] std::uint64_t published() const noexcept {
    return published_.load(std::memory_order_relaxed);
  }
  /// Readers of poses that are known now.
  [[nodiscard]] std::uint32_t readers() const noexcept {
    return readers_.load(std::memory_order_relaxed);
  }

 private:
  RosBus(const RosConfig& config, timesync::Doorbell bell, timesync::Doorbell stop_bell);
  void run(const std::stop_token& stop);
  [[nodiscard]] Result<void> talk(drivers::RosPublisher& publisher, const std::stop_token& stop);
  [[nodiscard]] Result<void> say_newest(drivers::RosPublisher& publisher);
  void say_trouble(const std::string& sentence);

  const RosConfig& config_;
  // Of the thread that made it.
  RateLimit rate_;
  std::uint32_t resets_ = 0;
  std::int64_t newest_capture_ns_ = std::numeric_limits<std::int64_t>::min();
  std::string trouble_;
  // Between the threads.
  timesync::Doorbell bell_;
  timesync::Doorbell stop_bell_;
  timesync::Latest<drivers::RosPose> poses_;
  timesync::Latest<std::vector<drivers::RosDiagnostic>> diagnostics_;
  timesync::Latest<std::string> troubles_;
  std::atomic<std::uint64_t> published_{0};
  std::atomic<std::uint32_t> readers_{0};
  std::string said_;  // the bus's thread: the trouble that was said last
  std::jthread thread_;
};

}  // namespace geoflow::daemon::bus
