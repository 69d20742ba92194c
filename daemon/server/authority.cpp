#include "server/authority.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <grp.h>
#include <sys/types.h>
#include <unistd.h>

#include "geoflow/hal/result.hpp"

#include "server/acceptor.hpp"

namespace geoflow::daemon {

Result<gid_t> find_group(const std::string& name) {
  const struct group* entry =
      ::getgrnam(name.c_str());  // NOLINT(concurrency-mt-unsafe): before any thread starts
  if (entry == nullptr) {
    return fail(ErrorCode::kInvalidArgument, "socket.group: no group is named {}", name);
  }
  return entry->gr_gid;
}

Authority::Authority(uid_t user, gid_t group, std::string group_name)
    : user_{user}, group_{group}, group_name_{std::move(group_name)} {}

Result<Authority> Authority::create(const std::string& group) {
  if (group.empty()) {
    const gid_t own = ::getegid();
    const struct group* entry =
        ::getgrgid(own);  // NOLINT(concurrency-mt-unsafe): before any thread starts
    return Authority{::geteuid(), own, entry != nullptr ? entry->gr_name : fmt::format("{}", own)};
  }
  return find_group(group).map([&](gid_t number) { return Authority{::geteuid(), number, group}; });
}

bool Authority::permits(const Connection& peer) const {
  return peer.uid == 0 || peer.uid == user_ || peer.gid == group_ ||
         std::ranges::find(peer.groups, group_) != peer.groups.end();
}

std::string Authority::refusal(const Connection& peer, const std::string& what) const {
  return fmt::format(
      "{}: not for user {} (process {}): it takes root, the daemon's own user ({}) or a member of "
      "the group {}",
      what, peer.uid, peer.pid, user_, group_name_);
}

}  // namespace geoflow::daemon
