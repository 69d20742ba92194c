#pragma once

#include <string>

#include <sys/types.h>

#include "geoflow/hal/result.hpp"

#include "server/acceptor.hpp"

namespace geoflow::daemon {

/// Who may change something through the control socket: root, the daemon's own user, and the
/// members of the socket's group. Immutable; thread-safe.
class Authority {
 public:
  /// For the group of this name; empty: the daemon's own. kInvalidArgument where there is no such
  /// group. Before any thread starts: it reads the group database.
  [[nodiscard]] static Result<Authority> create(const std::string& group);
  Authority(uid_t user, gid_t group, std::string group_name);

  /// Whether the peer may.
  [[nodiscard]] bool permits(const Connection& peer) const;
  /// Why it may not do `what`: a sentence that says who asks, and who may.
  [[nodiscard]] std::string refusal(const Connection& peer, const std::string& what) const;

 private:
  uid_t user_;
  gid_t group_;
  std::string group_name_;
};

/// The group's number. kInvalidArgument, naming the key `socket.group`, where there is no such
/// group. Before any thread starts.
[[nodiscard]] Result<gid_t> find_group(const std::string& name);

}  // namespace geoflow::daemon
