#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <unordered_map>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/acceptor.hpp"
#include "server/event_loop.hpp"
#include "server/pose_connection.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {

/// The pose socket: sends every published pose to every client that keeps up, and the newest to
/// those that do not. A client that says no HELLO in time, floods, or reads nothing for too long is
/// cut off. Thread-bound: the loop's.
class PoseServer {
 public:
  /// `clock_flags` (geoflow_clock_flags) are told to clients in WELCOME. A listening socket that is
  /// `given` stands in for the configured one. Errors as ListeningSocket::open().
  [[nodiscard]] static Result<std::unique_ptr<PoseServer>> create(EventLoop& loop,
                                                                  const SocketConfig& config,
                                                                  std::uint32_t clock_flags,
                                                                  UniqueFd given = {});
  PoseServer(const PoseServer&) = delete;
  PoseServer& operator=(const PoseServer&) = delete;
  ~PoseServer();

  /// Sends a pose to those who want its kind; a client that comes later is greeted with the newest
  /// of a frame.
  void publish(const geoflow_pose& pose);
  /// Tells those who want the frame's stream that it is there; of a cloud, which seldom comes, also
  /// clients that come later.
  void publish(const StreamedFrame& frame);
  /// Of which streams anybody wants frames (geoflow_want, or-ed).
  [[nodiscard]] std::uint32_t wanted_frames() const noexcept;
  /// Tells every client that nothing more follows, after what waits for it, and closes it.
  void finish(geoflow_end_reason reason);
  /// From now on these limits hold (clients, clients_per_user, handshake_timeout, stall_timeout).
  void set_limits(const SocketConfig& config);
  /// Cuts off clients whose time is over. To be called a few times a second.
  void check_timeouts();

  [[nodiscard]] std::size_t client_count() const noexcept { return clients_.size(); }
  /// For the status reply: one object a client, and what became of earlier ones.
  [[nodiscard]] nlohmann::json status() const;

 private:
  PoseServer(EventLoop& loop, const SocketConfig& config, std::uint32_t clock_flags);
  void on_connection(Connection connection);
  void on_ready(int fd, std::uint32_t events);
  void settle(PoseConnection& client, PoseConnection::Outcome outcome);
  template <typename Item>
  void offer_to_all(const Item& item);
  void close(int fd, std::string_view why);

  EventLoop& loop_;
  SocketConfig config_;
  geoflow_welcome welcome_{};
  std::unique_ptr<Acceptor> acceptor_;
  std::unordered_map<int, std::unique_ptr<PoseConnection>> clients_;
  std::optional<geoflow_pose> newest_;
  std::optional<StreamedFrame> newest_cloud_;
  std::uint32_t next_id_ = 1;
  std::uint64_t refused_ = 0;
  std::uint64_t cut_off_ = 0;
};

}  // namespace geoflow::daemon
