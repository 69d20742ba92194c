#include "server/listening_socket.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/un.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/authority.hpp"

namespace geoflow::daemon {
namespace {

constexpr int kBacklog = 16;
constexpr mode_t kLockMode = 0644;

std::string read_pid(int lock) {
  std::array<char, 32> text{};
  const ssize_t size = ::pread(lock, text.data(), text.size() - 1, 0);
  const std::string_view view{text.data(), size > 0 ? static_cast<std::size_t>(size) : 0};
  return std::string{view.substr(0, view.find('\n'))};
}

Result<UniqueFd> take_lock(const std::filesystem::path& path) {
  const std::string name = path.string() + ".lock";
  UniqueFd lock{::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, kLockMode)};
  if (!lock) {
    return fail_errno(name);
  }
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) {
      return fail_errno(name);
    }
    return fail(ErrorCode::kUnavailable, "{}: another daemon (process {}) holds this socket",
                path.string(), read_pid(lock.get()));
  }
  const std::string pid = fmt::format("{}\n", ::getpid());
  if (::ftruncate(lock.get(), 0) != 0 || ::pwrite(lock.get(), pid.data(), pid.size(), 0) < 0) {
    return fail_errno(name);
  }
  return lock;
}

/// The process that listens at the path, if anybody does. Connecting without waiting: a backlog
/// that is full is a listener's as well.
std::optional<pid_t> find_listener(const sockaddr_un& address) {
  for (const int type : {SOCK_SEQPACKET, SOCK_STREAM}) {
    const UniqueFd probe{::socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
    const void* generic = &address;
    if (probe &&
        ::connect(probe.get(), static_cast<const sockaddr*>(generic), sizeof address) == 0) {
      ucred listener{};
      socklen_t size = sizeof listener;
      ::getsockopt(probe.get(), SOL_SOCKET, SO_PEERCRED, &listener, &size);
      return listener.pid;
    }
    if (probe && errno == EAGAIN) {
      return pid_t{0};
    }
  }
  return std::nullopt;
}

/// Removes the socket that a daemon left behind; the lock is held.
Result<void> remove_stale(const std::filesystem::path& path, const sockaddr_un& address) {
  struct stat status{};
  if (::lstat(path.c_str(), &status) != 0) {
    return errno == ENOENT ? Result<void>{} : fail_errno(path.string());
  }
  if (!S_ISSOCK(status.st_mode)) {
    return fail(ErrorCode::kInvalidArgument, "{}: exists and is not a socket", path.string());
  }
  if (const auto pid = find_listener(address)) {
    return fail(ErrorCode::kUnavailable, "{}: another process ({}) listens at this socket",
                path.string(), *pid);
  }
  return ::unlink(path.c_str()) == 0 ? Result<void>{} : fail_errno(path.string());
}

Result<sockaddr_un> make_address(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.size() >= sizeof address.sun_path) {
    return fail(ErrorCode::kInvalidArgument, "{}: a socket's path has at most {} bytes", text,
                sizeof address.sun_path - 1);
  }
  std::memcpy(&address.sun_path[0], text.data(), text.size());
  return address;
}

Result<void> set_group(const std::filesystem::path& path, const std::string& group) {
  if (group.empty()) {
    return {};
  }
  return find_group(group).and_then([&](gid_t number) -> Result<void> {
    if (::chown(path.c_str(), static_cast<uid_t>(-1), number) != 0) {
      return fail_errno(fmt::format("{}: group {}", path.string(), group));
    }
    return {};
  });
}

/// Binds, sets owner and permissions, and only then listens: nobody connects under the wrong ones.
Result<UniqueFd> bind_and_listen(const ListeningSocket::Options& options,
                                 const sockaddr_un& address) {
  UniqueFd socket{::socket(AF_UNIX, options.type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
  const void* generic = &address;
  if (!socket || ::bind(socket.get(), static_cast<const sockaddr*>(generic), sizeof address) != 0) {
    return fail_errno(options.path.string());
  }
  auto grouped = set_group(options.path, options.group);
  if (!grouped) {
    return tl::unexpected{std::move(grouped.error())};
  }
  if (::chmod(options.path.c_str(), static_cast<mode_t>(options.mode)) != 0 ||
      ::listen(socket.get(), kBacklog) != 0) {
    return fail_errno(options.path.string());
  }
  return socket;
}

}  // namespace

Result<ListeningSocket> ListeningSocket::open(const Options& options) {
  const auto address = make_address(options.path);
  if (!address) {
    return tl::unexpected{address.error()};
  }
  auto lock = take_lock(options.path);
  if (!lock) {
    return tl::unexpected{std::move(lock.error())};
  }
  auto removed = remove_stale(options.path, *address);
  if (!removed) {
    return tl::unexpected{std::move(removed.error())};
  }
  auto socket = bind_and_listen(options, *address);
  if (!socket) {
    return tl::unexpected{std::move(socket.error())};
  }
  return ListeningSocket{options.path, std::move(*lock), std::move(*socket)};
}

Result<ListeningSocket> ListeningSocket::open_unless_given(const Options& options, UniqueFd given) {
  return given ? ListeningSocket{{}, {}, std::move(given)} : open(options);
}

ListeningSocket::~ListeningSocket() {
  if (socket_ && !path_.empty()) {
    ::unlink(path_.c_str());  // before the lock goes, so never another daemon's
  }
}

}  // namespace geoflow::daemon
