#include "server/control_server.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/version.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/acceptor.hpp"
#include "server/authority.hpp"
#include "server/client_limit.hpp"
#include "server/control_connection.hpp"
#include "server/event_loop.hpp"
#include "server/listening_socket.hpp"

namespace geoflow::daemon {
namespace {

nlohmann::json greeting() {
  return {{"hello", "geoflowd"},
          {"version", std::string{version()}},
          {"protocol", {GEOFLOW_PROTOCOL_MAJOR, GEOFLOW_PROTOCOL_MINOR}}};
}

}  // namespace

ControlServer::ControlServer(EventLoop& loop, const SocketConfig& config, ControlHandlers handlers,
                             Authority authority)
    : loop_{loop},
      config_{config},
      handlers_{std::move(handlers)},
      authority_{std::move(authority)} {}

ControlServer::~ControlServer() {
  while (!clients_.empty()) {
    close(clients_.begin()->first);
  }
}

Result<std::unique_ptr<ControlServer>> ControlServer::create(EventLoop& loop,
                                                             const SocketConfig& config,
                                                             ControlHandlers handlers,
                                                             UniqueFd given) {
  auto authority = Authority::create(config.group);
  if (!authority) {
    return tl::unexpected{std::move(authority.error())};
  }
  auto socket = ListeningSocket::open_unless_given(
      {.path = config.control, .type = SOCK_STREAM, .mode = config.mode, .group = config.group},
      std::move(given));
  if (!socket) {
    return tl::unexpected{std::move(socket.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  std::unique_ptr<ControlServer> server{
      new ControlServer{loop, config, std::move(handlers), std::move(*authority)}};
  auto acceptor = Acceptor::create(
      loop, std::move(*socket),
      [self = server.get()](Connection connection) { self->on_connection(std::move(connection)); });
  if (!acceptor) {
    return tl::unexpected{std::move(acceptor.error())};
  }
  server->acceptor_ = std::move(*acceptor);
  return server;
}

void ControlServer::on_connection(Connection connection) {
  const int fd = connection.fd.get();
  const HostTime now = HostClock::now();
  auto client = std::make_unique<ControlConnection>(std::move(connection), next_number_++, now);
  if (const std::string why = reason_to_refuse(clients_, config_, client->peer().uid);
      !why.empty()) {
    client->say({{"ok", false}, {"error", {{"code", "unavailable"}, {"message", why}}}}, now);
    (void)client->flush(now);
    return;
  }
  if (loop_.add(fd, EPOLLIN, [this, fd](std::uint32_t events) { on_ready(fd, events); })) {
    client->say(greeting(), now);
    (void)client->flush(now);
    clients_.emplace(fd, std::move(client));
  }
}

void ControlServer::on_ready(int fd, std::uint32_t events) {
  ControlConnection& client = *clients_.at(fd);
  const HostTime now = HostClock::now();
  bool alive = (events & EPOLLOUT) == 0 || client.flush(now);
  // One who does not read his replies is not listened to either.
  if (alive && !client.blocked() && (events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) {
    alive = client.receive(handlers_, authority_, now);
  }
  if (!alive) {
    close(fd);
    return;
  }
  loop_.modify(fd, client.blocked() ? EPOLLOUT : EPOLLIN);
}

void ControlServer::close(int fd) {
  loop_.remove(fd);
  clients_.erase(fd);
}

void ControlServer::publish(const geoflow_pose& pose) {
  const HostTime now = HostClock::now();
  std::vector<int> lost;
  for (const auto& [fd, client] : clients_) {
    client->offer(pose, now);
    if (!client->blocked()) {
      continue;
    }
    if (!client->flush(now)) {
      lost.push_back(fd);
    } else if (client->blocked()) {
      loop_.modify(fd, EPOLLOUT);
    }
  }
  for (const int fd : lost) {
    close(fd);
  }
}

void ControlServer::conclude(const Asker& asker, const Result<nlohmann::json>& outcome) {
  for (const auto& [fd, client] : clients_) {
    if (client->number() == asker.client) {
      client->conclude(asker, outcome, HostClock::now());
      loop_.modify(fd, EPOLLOUT);  // sent from there: it may be its own request that is answered
    }
  }
}

void ControlServer::set_limits(const SocketConfig& config) {
  config_.clients = config.clients;
  config_.clients_per_user = config.clients_per_user;
  config_.stall_timeout = config.stall_timeout;
}

void ControlServer::check_timeouts() {
  const HostTime now = HostClock::now();
  std::vector<int> late;
  for (const auto& [fd, client] : clients_) {
    if (client->blocked() && now - client->waiting_since() > config_.stall_timeout) {
      late.push_back(fd);
      log::warning("server", "a control client (process {}, user {}) reads nothing and was cut off",
                   client->peer().pid, client->peer().uid);
    }
  }
  for (const int fd : late) {
    close(fd);
  }
}

}  // namespace geoflow::daemon
