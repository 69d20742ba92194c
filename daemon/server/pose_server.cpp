#include "server/pose_server.hpp"

#include <array>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/epoll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/version.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/acceptor.hpp"
#include "server/client_limit.hpp"
#include "server/event_loop.hpp"
#include "server/listening_socket.hpp"
#include "server/pose_connection.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {
namespace {

using Outcome = PoseConnection::Outcome;

/// The kernel's boot id as 16 bytes; zero where it cannot be read.
void read_boot_id(std::span<std::uint8_t> id) {
  std::ifstream file{"/proc/sys/kernel/random/boot_id"};
  std::string text;
  std::getline(file, text);
  std::erase(text, '-');
  constexpr int kHexadecimal = 16;
  for (std::size_t i = 0; i < id.size() && 2 * i + 1 < text.size(); ++i) {
    std::from_chars(&text[2 * i], &text[2 * i] + 2, id[i], kHexadecimal);
  }
}

void write_limits(const SocketConfig& config, geoflow_welcome& welcome) {
  welcome.max_clients = static_cast<std::uint32_t>(config.clients);
  welcome.stall_timeout_ms = static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::milliseconds>(config.stall_timeout).count());
}

geoflow_welcome make_welcome(const SocketConfig& config, std::uint32_t clock_flags) {
  geoflow_welcome welcome{};
  welcome.major = GEOFLOW_PROTOCOL_MAJOR;
  welcome.minor = GEOFLOW_PROTOCOL_MINOR;
  if (::getrandom(&welcome.instance[0], sizeof welcome.instance, GRND_NONBLOCK) < 0) {
    log::warning("server", "no random numbers yet: this start has no instance id");
  }
  read_boot_id(welcome.boot_id);
  welcome.clock_flags = clock_flags;
  welcome.max_request_bytes = GEOFLOW_MAX_RECORD;
  write_limits(config, welcome);
  copy_text(welcome.version, version());
  return welcome;
}

}  // namespace

PoseServer::PoseServer(EventLoop& loop, const SocketConfig& config, std::uint32_t clock_flags)
    : loop_{loop}, config_{config}, welcome_{make_welcome(config, clock_flags)} {}

PoseServer::~PoseServer() {
  while (!clients_.empty()) {
    close(clients_.begin()->first, {});
  }
}

Result<std::unique_ptr<PoseServer>> PoseServer::create(EventLoop& loop, const SocketConfig& config,
                                                       std::uint32_t clock_flags, UniqueFd given) {
  auto socket = ListeningSocket::open_unless_given(
      {.path = config.pose, .type = SOCK_SEQPACKET, .mode = config.mode, .group = config.group},
      std::move(given));
  if (!socket) {
    return tl::unexpected{std::move(socket.error())};
  }
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  std::unique_ptr<PoseServer> server{new PoseServer{loop, config, clock_flags}};
  auto acceptor = Acceptor::create(
      loop, std::move(*socket),
      [self = server.get()](Connection connection) { self->on_connection(std::move(connection)); });
  if (!acceptor) {
    return tl::unexpected{std::move(acceptor.error())};
  }
  server->acceptor_ = std::move(*acceptor);
  return server;
}

void PoseServer::on_connection(Connection connection) {
  const int fd = connection.fd.get();
  auto client =
      std::make_unique<PoseConnection>(std::move(connection), next_id_++, HostClock::now());
  if (const std::string why = reason_to_refuse(clients_, config_, client->peer().uid);
      !why.empty()) {
    ++refused_;
    client->refuse(GEOFLOW_REFUSE_FULL, why);
    return;
  }
  if (loop_.add(fd, EPOLLIN, [this, fd](std::uint32_t events) { on_ready(fd, events); })) {
    clients_.emplace(fd, std::move(client));
  }
}

void PoseServer::on_ready(int fd, std::uint32_t events) {
  PoseConnection& client = *clients_.at(fd);
  const HostTime now = HostClock::now();
  Outcome outcome = Outcome::kOpen;
  const bool was_welcomed = client.welcomed();
  if ((events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) {
    welcome_.realtime_minus_mono_ns = realtime_minus_monotonic().count();
    outcome = client.receive(welcome_, now);
  }
  if (outcome == Outcome::kOpen && !was_welcomed && client.welcomed()) {
    log::debug("server", "client {} '{}' (process {}, user {}) connected", client.id(),
               client.name(), client.peer().pid, client.peer().uid);
    outcome = newest_ ? client.offer(*newest_, now) : outcome;
    if (outcome == Outcome::kOpen && newest_cloud_) {
      outcome = client.offer(*newest_cloud_, now);
    }
  }
  if (outcome == Outcome::kOpen && (events & EPOLLOUT) != 0) {
    outcome = client.flush(now);
  }
  settle(client, outcome);
}

void PoseServer::settle(PoseConnection& client, Outcome outcome) {
  if (outcome != Outcome::kOpen) {
    close(client.fd(), {});
    return;
  }
  loop_.modify(client.fd(), client.blocked() ? EPOLLIN | EPOLLOUT : EPOLLIN);
}

void PoseServer::close(int fd, std::string_view why) {
  const auto found = clients_.find(fd);
  if (!why.empty()) {
    ++cut_off_;
    log::warning("server", "client {} '{}' (process {}, user {}) {}", found->second->id(),
                 found->second->name(), found->second->peer().pid, found->second->peer().uid, why);
  }
  loop_.remove(fd);
  clients_.erase(found);
}

void PoseServer::publish(const geoflow_pose& pose) {
  if (!is_propagated(pose)) {
    newest_ = pose;
  }
  offer_to_all(pose);
}

void PoseServer::publish(const StreamedFrame& frame) {
  if (frame.frame.stream == GEOFLOW_CLOUD) {
    newest_cloud_ = frame;
  }
  offer_to_all(frame);
}

std::uint32_t PoseServer::wanted_frames() const noexcept {
  std::uint32_t wanted = 0;
  for (const auto& [fd, client] : clients_) {
    wanted |= client->wanted_frames();
  }
  return wanted;
}

template <typename Item>
void PoseServer::offer_to_all(const Item& item) {
  const HostTime now = HostClock::now();
  std::vector<int> lost;
  for (const auto& [fd, client] : clients_) {
    const bool was_blocked = client->blocked();
    if (client->offer(item, now) != Outcome::kOpen) {
      lost.push_back(fd);
    } else if (client->blocked() != was_blocked) {
      settle(*client, Outcome::kOpen);
    }
  }
  for (const int fd : lost) {
    close(fd, {});
  }
}

void PoseServer::finish(geoflow_end_reason reason) {
  const HostTime now = HostClock::now();
  std::vector<int> done;
  for (const auto& [fd, client] : clients_) {
    if (client->finish(reason, now) != Outcome::kOpen) {
      done.push_back(fd);
    } else {
      settle(*client, Outcome::kOpen);
    }
  }
  for (const int fd : done) {
    close(fd, {});
  }
}

void PoseServer::set_limits(const SocketConfig& config) {
  config_.clients = config.clients;
  config_.clients_per_user = config.clients_per_user;
  config_.handshake_timeout = config.handshake_timeout;
  config_.stall_timeout = config.stall_timeout;
  write_limits(config_, welcome_);
}

void PoseServer::check_timeouts() {
  const HostTime now = HostClock::now();
  std::vector<std::pair<int, std::string_view>> late;
  for (const auto& [fd, client] : clients_) {
    const Duration waited = now - client->waiting_since();
    if (!client->welcomed() && waited > config_.handshake_timeout) {
      client->refuse(GEOFLOW_REFUSE_TIMEOUT, "no HELLO in time");
      late.emplace_back(fd, "said no HELLO in time");
    } else if (client->blocked() && waited > config_.stall_timeout) {
      late.emplace_back(fd, "reads nothing and was cut off");
    }
  }
  for (const auto& [fd, why] : late) {
    close(fd, why);
  }
}

nlohmann::json PoseServer::status() const {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [fd, client] : clients_) {
    list.push_back({{"id", client->id()},
                    {"name", client->name()},
                    {"pid", client->peer().pid},
                    {"uid", client->peer().uid},
                    {"sent", client->sent()},
                    {"dropped", client->dropped()}});
  }
  return {{"clients", std::move(list)}, {"refused", refused_}, {"cut_off", cut_off_}};
}

}  // namespace geoflow::daemon
