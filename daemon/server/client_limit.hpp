#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include <fmt/core.h>
#include <sys/types.h>

#include "geoflow/daemon/config.hpp"

namespace geoflow::daemon {

/// Why a server whose `clients` are connected takes no further one of user `uid`; empty: it does.
/// One user cannot take up all the room that others need. Pure.
template <typename Clients>
[[nodiscard]] std::string reason_to_refuse(const Clients& clients, const SocketConfig& config,
                                           uid_t uid) {
  if (clients.size() >= static_cast<std::size_t>(config.clients)) {
    return "too many clients";
  }
  const auto of_user = std::ranges::count_if(
      clients, [&](const auto& client) { return client.second->peer().uid == uid; });
  return of_user >= config.clients_per_user ? fmt::format("too many clients of user {}", uid) : "";
}

}  // namespace geoflow::daemon
