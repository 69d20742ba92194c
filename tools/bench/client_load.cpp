#include "bench/client_load.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <random>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <poll.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::tools {
namespace {

constexpr int kLowestPriority = 19;
constexpr std::uint64_t kDatagramsAtOnce = 16;

}  // namespace

UniqueFd connect_to_poses(const std::filesystem::path& path) {
  UniqueFd fd{::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = path.string();
  if (!fd || name.size() >= sizeof address.sun_path) {
    return {};
  }
  std::memcpy(&address.sun_path[0], name.data(), name.size());
  const void* const generic = &address;
  return ::connect(fd.get(), static_cast<const sockaddr*>(generic), sizeof address) == 0
             ? std::move(fd)
             : UniqueFd{};
}

namespace {

bool say_hello(int fd) {
  geoflow_hello hello{};
  hello.client_major = GEOFLOW_PROTOCOL_MAJOR;
  hello.client_minor = GEOFLOW_PROTOCOL_MINOR;
  hello.want = GEOFLOW_WANT_POSE | GEOFLOW_WANT_PROPAGATED;
  daemon::copy_text(hello.name, "load");
  const auto record = daemon::encode_record(GEOFLOW_HELLO, 0, 0, hello);
  return ::send(fd, record.data(), record.size(), MSG_NOSIGNAL) >= 0;
}

enum class Kind : std::uint8_t { kReader, kDeaf, kGarbler };

struct Client {
  Kind kind;
  UniqueFd fd{};
};

/// Noise of any size, every second time behind a header as it should be.
class Garbage {
 public:
  std::span<const std::byte> next() {
    for (std::byte& byte : noise_) {
      byte = static_cast<std::byte>(random_());
    }
    const std::span<const std::byte> noise{noise_.data(), random_() % noise_.size() + 1};
    if (random_() % 2 == 0) {
      return noise;
    }
    record_ = daemon::encode_record(static_cast<geoflow_record_type>(random_() % 8), 0, 0, noise);
    return record_;
  }

 private:
  static constexpr std::size_t kLargest = 512;
  std::minstd_rand random_{1};
  std::array<std::byte, kLargest> noise_{};
  std::vector<std::byte> record_;
};

/// What a client has done in its turn: datagrams, and whether its connection has ended.
struct Turn {
  std::uint64_t datagrams = 0;
  bool ended = false;
};

Turn drain(int fd) {
  std::array<std::byte, GEOFLOW_MAX_RECORD> record{};
  Turn turn;
  while (true) {
    const auto size = ::recv(fd, record.data(), record.size(), 0);
    if (size <= 0) {
      turn.ended = size == 0 || errno != EAGAIN;
      return turn;
    }
    ++turn.datagrams;
  }
}

Turn garble(int fd, Garbage& garbage) {
  Turn turn;
  while (turn.datagrams < kDatagramsAtOnce) {
    const auto datagram = garbage.next();
    if (::send(fd, datagram.data(), datagram.size(), MSG_NOSIGNAL) < 0) {
      turn.ended = errno != EAGAIN;
      return turn;
    }
    ++turn.datagrams;
  }
  return turn;
}

Turn hear_nothing(int fd) {
  pollfd waiting{.fd = fd, .events = 0, .revents = 0};
  return {.ended = ::poll(&waiting, 1, 0) > 0};  // hung up
}

/// Connected, and with a HELLO but from those who send garbage.
UniqueFd open(Kind kind, const std::filesystem::path& socket) {
  UniqueFd fd = connect_to_poses(socket);
  return fd && (kind == Kind::kGarbler || say_hello(fd.get())) ? std::move(fd) : UniqueFd{};
}

std::vector<Client> make_clients(const ClientLoadOptions& options) {
  std::vector<Client> clients;
  const auto add = [&](Kind kind, int count) {
    for (int i = 0; i < count; ++i) {
      clients.push_back({.kind = kind});
    }
  };
  add(Kind::kReader, options.readers);
  add(Kind::kDeaf, options.deaf);
  add(Kind::kGarbler, options.garblers);
  return clients;
}

}  // namespace

ClientLoad::ClientLoad(const ClientLoadOptions& options)
    : thread_{[this, options](const std::stop_token& stop) {
        ::pthread_setname_np(::pthread_self(), "load");
        (void)::setpriority(PRIO_PROCESS, 0, kLowestPriority);  // of this thread, on Linux
        run(options, stop);
      }} {}

void ClientLoad::run(const ClientLoadOptions& options, const std::stop_token& stop) {
  std::vector<Client> clients = make_clients(options);
  Garbage garbage;
  const auto act = [&](const Client& client) {
    Turn turn;
    if (client.kind == Kind::kReader) {
      turn = drain(client.fd.get());
      records_ += turn.datagrams;
    } else if (client.kind == Kind::kGarbler) {
      turn = garble(client.fd.get(), garbage);
      garbage_ += turn.datagrams;
    } else {
      turn = hear_nothing(client.fd.get());
    }
    return !turn.ended;
  };
  while (!stop.stop_requested()) {
    for (Client& client : clients) {
      if (!client.fd) {
        client.fd = open(client.kind, options.socket);
      }
      if (client.fd && !act(client)) {
        client.fd.reset();
      }
    }
  }
}

}  // namespace geoflow::tools
