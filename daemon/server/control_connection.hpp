#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/time.hpp"

#include "protocol/control_request.hpp"
#include "server/acceptor.hpp"
#include "server/token_bucket.hpp"

namespace geoflow::daemon {

/// One client of the control socket: a line in, a line out, and poses while it watches. Its buffers
/// are bounded; never blocks. Thread-bound: the loop's.
class ControlConnection {
 public:
  /// Gives the status reply.
  using StatusProvider = std::function<nlohmann::json()>;

  ControlConnection(Connection connection, HostTime now);

  /// Reads and answers what has come. False: close it (it broke the rules, or has gone).
  [[nodiscard]] bool receive(const StatusProvider& status, HostTime now);
  /// Queues a pose if it watches and keeps up; else counts it as dropped.
  void offer(const geoflow_pose& pose, HostTime now);
  /// Queues one JSON line for flush().
  void say(const nlohmann::json& line, HostTime now);
  /// Sends what waits; false when the client has gone.
  [[nodiscard]] bool flush(HostTime now);

  [[nodiscard]] int fd() const noexcept { return connection_.fd.get(); }
  [[nodiscard]] bool blocked() const noexcept { return !output_.empty(); }
  [[nodiscard]] HostTime waiting_since() const noexcept { return waiting_since_; }
  [[nodiscard]] const Connection& peer() const noexcept { return connection_; }

 private:
  void answer(std::string_view line, const StatusProvider& status, HostTime now);
  [[nodiscard]] nlohmann::json reply_to(const ControlRequest& request,
                                        const StatusProvider& status);
  [[nodiscard]] bool answer_lines(const StatusProvider& status, HostTime now);

  Connection connection_;
  std::string input_;
  std::string output_;
  std::optional<RateLimit> watch_;
  std::uint64_t dropped_since_last_ = 0;
  TokenBucket requests_;
  HostTime waiting_since_;
};

}  // namespace geoflow::daemon
