#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/acceptor.hpp"
#include "server/authority.hpp"
#include "server/control_connection.hpp"
#include "server/event_loop.hpp"

namespace geoflow::daemon {

/// The control socket: JSON lines for people and scripts (docs/protocol.md). Thread-bound: the
/// loop's.
class ControlServer {
 public:
  /// A listening socket that is `given` stands in for the configured one. Errors as
  /// ListeningSocket::open().
  [[nodiscard]] static Result<std::unique_ptr<ControlServer>> create(EventLoop& loop,
                                                                     const SocketConfig& config,
                                                                     ControlHandlers handlers,
                                                                     UniqueFd given = {});
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;
  ~ControlServer();

  /// Sends a pose to those who watch.
  void publish(const geoflow_pose& pose);
  /// Answers a client that asked for a change, if it is still there.
  void conclude(const Asker& asker, const Result<nlohmann::json>& outcome);
  /// From now on these limits hold (clients, clients_per_user, stall_timeout).
  void set_limits(const SocketConfig& config);
  /// Cuts off clients that read nothing for too long. To be called a few times a second.
  void check_timeouts();

  [[nodiscard]] std::size_t client_count() const noexcept { return clients_.size(); }

 private:
  ControlServer(EventLoop& loop, const SocketConfig& config, ControlHandlers handlers,
                Authority authority);
  void on_connection(Connection connection);
  void on_ready(int fd, std::uint32_t events);
  void close(int fd);

  EventLoop& loop_;
  SocketConfig config_;
  ControlHandlers handlers_;
  Authority authority_;
  std::uint64_t next_number_ = 1;
  std::unique_ptr<Acceptor> acceptor_;
  std::unordered_map<int, std::unique_ptr<ControlConnection>> clients_;
};

}  // namespace geoflow::daemon
