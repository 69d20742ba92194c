#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <sys/types.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/event_loop.hpp"
#include "server/listening_socket.hpp"

namespace geoflow::daemon {

/// A connection just accepted and whose it is, as the kernel knows (SO_PEERCRED, SO_PEERGROUPS).
struct Connection {
  UniqueFd fd;
  pid_t pid = 0;
  uid_t uid = 0;
  gid_t gid = 0;
  std::vector<gid_t> groups{};  ///< supplementary ones
};

/// Accepts on one listening socket: nonblocking connections with small send buffers, so that a
/// client that does not read holds few stale records. When the process has but a few descriptors
/// left, which it needs itself, or none, connections are closed rather than left to spin the loop.
/// Thread-bound: the loop's.
class Acceptor {
 public:
  using Handler = std::function<void(Connection)>;

  [[nodiscard]] static Result<std::unique_ptr<Acceptor>> create(EventLoop& loop,
                                                                ListeningSocket socket,
                                                                Handler handler);
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;
  ~Acceptor();

 private:
  Acceptor(EventLoop& loop, ListeningSocket socket, Handler handler);
  void accept_some();
  void shed_one();

  EventLoop& loop_;
  ListeningSocket socket_;
  Handler handler_;
  UniqueFd spare_;  ///< given up for a moment to accept and close what cannot be served
};

}  // namespace geoflow::daemon
