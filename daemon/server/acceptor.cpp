#include "server/acceptor.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "server/event_loop.hpp"
#include "server/listening_socket.hpp"

namespace geoflow::daemon {
namespace {

constexpr int kAcceptsAtOnce = 16;
constexpr int kSendBufferBytes = 8192;  // about 13 poses; the default holds 167

/// Descriptors that clients are not given: the daemon's own work opens files and devices anew,
/// those of a recording, a map to be saved, a camera that was plugged in again.
constexpr rlim_t kReserved = 16;

/// Whether a descriptor that was just given, the lowest that was free, is one of the last.
bool is_among_the_last(int fd) {
  rlimit limit{};
  return ::getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY &&
         static_cast<rlim_t>(fd) + kReserved >= limit.rlim_cur;
}

UniqueFd open_spare() {
  return UniqueFd{::open("/dev/null", O_RDONLY | O_CLOEXEC)};
}

std::vector<gid_t> peer_groups(int fd) {
  constexpr std::size_t kMostGroups = 65536;  // NGROUPS_MAX of Linux
  std::vector<gid_t> groups(16);
  auto size = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
  while (::getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) {
    if (errno != ERANGE || groups.size() >= kMostGroups) {
      return {};
    }
    groups.resize(size / sizeof(gid_t));
  }
  groups.resize(size / sizeof(gid_t));
  return groups;
}

Connection describe(UniqueFd fd) {
  ::setsockopt(fd.get(), SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
  ucred credentials{};
  socklen_t size = sizeof credentials;
  ::getsockopt(fd.get(), SOL_SOCKET, SO_PEERCRED, &credentials, &size);
  auto groups = peer_groups(fd.get());
  return {.fd = std::move(fd),
          .pid = credentials.pid,
          .uid = credentials.uid,
          .gid = credentials.gid,
          .groups = std::move(groups)};
}

}  // namespace

Result<std::unique_ptr<Acceptor>> Acceptor::create(EventLoop& loop, ListeningSocket socket,
                                                   Handler handler) {
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  std::unique_ptr<Acceptor> acceptor{new Acceptor{loop, std::move(socket), std::move(handler)}};
  auto added = loop.add(acceptor->socket_.fd(), EPOLLIN,
                        [self = acceptor.get()](std::uint32_t /*events*/) { self->accept_some(); });
  if (!added) {
    return tl::unexpected{std::move(added.error())};
  }
  return acceptor;
}

Acceptor::Acceptor(EventLoop& loop, ListeningSocket socket, Handler handler)
    : loop_{loop}, socket_{std::move(socket)}, handler_{std::move(handler)}, spare_{open_spare()} {}

Acceptor::~Acceptor() {
  loop_.remove(socket_.fd());
}

void Acceptor::accept_some() {
  for (int i = 0; i < kAcceptsAtOnce; ++i) {
    UniqueFd fd{::accept4(socket_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
    if (fd && is_among_the_last(fd.get())) {
      log::warning("server", "out of file descriptors for clients: a connection was closed");
    } else if (fd) {
      handler_(describe(std::move(fd)));
    } else if (errno == EMFILE || errno == ENFILE) {
      shed_one();
      return;
    } else if (errno != EINTR && errno != ECONNABORTED) {
      return;
    }
  }
}

void Acceptor::shed_one() {
  log::warning("server", "out of file descriptors: a connection was closed");
  spare_.reset();
  UniqueFd refused{::accept4(socket_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
  refused.reset();  // its number is the spare's again
  spare_ = open_spare();
}

}  // namespace geoflow::daemon
