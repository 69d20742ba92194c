#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

/// A listening AF_UNIX socket with its file. The file's lock (`<path>.lock`, held as long as the
/// object lives, with the holder's pid inside) decides who owns the path, so a socket file left by
/// a daemon that was killed is replaced and a running daemon's never is; nor is one that anybody
/// listens at without such a lock, as a service manager does. The socket file is removed at
/// destruction. Thread-compatible.
class ListeningSocket {
 public:
  struct Options {
    std::filesystem::path path;
    int type = 0;       ///< SOCK_SEQPACKET or SOCK_STREAM
    int mode = 0;       ///< permissions of the file
    std::string group;  ///< its group; empty: the process's own
  };

  /// Errors: kUnavailable, with the pid, where another process owns the path; kInvalidArgument for
  /// a path that is too long, is something else than a socket, or for an unknown group; kNotFound,
  /// kSystem for the rest.
  [[nodiscard]] static Result<ListeningSocket> open(const Options& options);
  /// The same, unless somebody else has made a listening socket and passed it on: then that one,
  /// whose file is theirs and stays.
  [[nodiscard]] static Result<ListeningSocket> open_unless_given(const Options& options,
                                                                 UniqueFd given);

  ListeningSocket(ListeningSocket&&) noexcept = default;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ListeningSocket(const ListeningSocket&) = delete;
  ListeningSocket& operator=(const ListeningSocket&) = delete;
  ~ListeningSocket();

  [[nodiscard]] int fd() const noexcept { return socket_.get(); }

 private:
  ListeningSocket(std::filesystem::path path, UniqueFd lock, UniqueFd socket)
      : path_{std::move(path)}, lock_{std::move(lock)}, socket_{std::move(socket)} {}

  std::filesystem::path path_;  // to be removed; empty: not ours
  UniqueFd lock_;
  UniqueFd socket_;
};

}  // namespace geoflow::daemon
