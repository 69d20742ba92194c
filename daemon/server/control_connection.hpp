#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "protocol/control_request.hpp"
#include "server/acceptor.hpp"
#include "server/authority.hpp"
#include "server/token_bucket.hpp"

namespace geoflow::daemon {

/// Who asked for a change, for the answer, which may come later.
struct Asker {
  std::uint64_t client = 0;  ///< number of the connection
  std::string name;          ///< the command's word
  nlohmann::json id;         ///< as in the request
};

/// What the control socket's clients can have.
struct ControlHandlers {
  std::function<nlohmann::json()> status;  ///< gives the status reply
  std::function<nlohmann::json()> config;  ///< gives every key with its value
  /// Begins a change; ControlServer::conclude() is to be called once, now or later.
  std::function<void(const ChangeRequest&, const Asker&)> change;
};

/// One client of the control socket: a line in, a line out, and poses while it watches. Its buffers
/// are bounded; never blocks. Thread-bound: the loop's.
class ControlConnection {
 public:
  /// `number` tells it from all connections there have been.
  ControlConnection(Connection connection, std::uint64_t number, HostTime now);

  /// Reads and answers what has come. False: close it (it broke the rules, or has gone).
  [[nodiscard]] bool receive(const ControlHandlers& handlers, const Authority& authority,
                             HostTime now);
  /// Queues the outcome of a change that it asked for.
  void conclude(const Asker& asker, const Result<nlohmann::json>& outcome, HostTime now);
  /// Queues a pose if it watches and keeps up; else counts it as dropped.
  void offer(const geoflow_pose& pose, HostTime now);
  /// Queues one JSON line for flush().
  void say(const nlohmann::json& line, HostTime now);
  /// Sends what waits; false when the client has gone.
  [[nodiscard]] bool flush(HostTime now);

  [[nodiscard]] int fd() const noexcept { return connection_.fd.get(); }
  [[nodiscard]] bool blocked() const noexcept { return !output_.empty(); }
  [[nodiscard]] HostTime waiting_since() const noexcept { return waiting_since_; }
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
  [[nodiscard]] const Connection& peer() const noexcept { return connection_; }

 private:
  /// What requests are answered from.
  struct Desk {
    const ControlHandlers& handlers;
    const Authority& authority;
    HostTime now;
  };
  void answer(std::string_view line, const Desk& desk);
  void begin(const ChangeRequest& change, const ControlRequest& request, const Desk& desk);
  [[nodiscard]] nlohmann::json reply_to(const ControlRequest& request,
                                        const ControlHandlers& handlers);
  [[nodiscard]] bool answer_lines(const Desk& desk);

  Connection connection_;
  std::uint64_t number_;
  std::string input_;
  std::string output_;
  std::optional<RateLimit> watch_;
  std::uint64_t dropped_since_last_ = 0;
  TokenBucket requests_;
  HostTime waiting_since_;
};

}  // namespace geoflow::daemon
