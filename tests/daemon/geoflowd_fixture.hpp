#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/un.h>

#include "geoflow/hal/unique_fd.hpp"
#include "tests/support/data.hpp"

#include "notify_socket.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {

using tests::NotifySocket;

using Words = std::vector<std::string>;

inline Words joined(Words first, const Words& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// The daemon itself under a service manager's protocol.
class GeoflowdService : public testing::Test {
 protected:
  [[nodiscard]] const std::filesystem::path& path() const { return directory_.path(); }
  [[nodiscard]] std::filesystem::path log(const std::string& name) const { return path() / name; }

  /// `env` with the manager's variables, the program and its sockets.
  [[nodiscard]] Words daemon(const Words& variables, const Words& options) const {
    return joined(joined({"/usr/bin/env", "NOTIFY_SOCKET=" + manager_.path().string()}, variables),
                  joined({GEOFLOWD_PROGRAM, "--pose-socket", pose_.string(), "--control-socket",
                          control_.string()},
                         options));
  }
  [[nodiscard]] Words replay(const tests::SyntheticRecording& recording = {}) const {
    tests::write_synthetic_recording(recording_, recording);
    return {"--replay", recording_.string(), "--loop"};
  }
  static Words absent_camera() {
    return {"--set", "source.camera=d435i", "--set", "d435i.serial=\"000000000000\""};
  }

  /// The reply to `{"cmd":"status"}`.
  [[nodiscard]] nlohmann::json status() const {
    const UniqueFd fd{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
    const sockaddr_un address = address_of(control_);
    const void* generic = &address;
    EXPECT_EQ(::connect(fd.get(), static_cast<const sockaddr*>(generic), sizeof address), 0);
    const std::string request = "{\"cmd\":\"status\"}\n";
    EXPECT_EQ(::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    std::string lines;
    std::array<char, 4096> buffer{};
    while (std::ranges::count(lines, '\n') < 2) {  // the greeting, then the reply
      const ssize_t size = ::recv(fd.get(), buffer.data(), buffer.size(), 0);
      if (size <= 0) {
        ADD_FAILURE() << "no reply: " << lines;
        return {};
      }
      lines.append(buffer.data(), static_cast<std::size_t>(size));
    }
    return nlohmann::json::parse(lines.substr(lines.find('\n') + 1)).at("status");
  }

  static sockaddr_un address_of(const std::filesystem::path& socket) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(&address.sun_path[0], socket.c_str(), sizeof address.sun_path - 1);
    return address;
  }
  /// A listening socket as a service manager makes it, with a number that a shell can pass on.
  static UniqueFd listening(const std::filesystem::path& socket, int type) {
    const UniqueFd fd{::socket(AF_UNIX, type, 0)};
    if (!fd) {
      throw std::runtime_error{"no socket"};
    }
    const sockaddr_un address = address_of(socket);
    const void* generic = &address;
    EXPECT_EQ(::bind(fd.get(), static_cast<const sockaddr*>(generic), sizeof address), 0);
    EXPECT_EQ(::listen(fd.get(), 8), 0);
    constexpr int kAboveThoseOfTheProtocol = 20;
    return UniqueFd{::fcntl(fd.get(), F_DUPFD, kAboveThoseOfTheProtocol)};
  }
  /// As daemon(), with these descriptors passed as 3 and 4 under these names.
  [[nodiscard]] Words activated(const UniqueFd& first, const UniqueFd& second,
                                const std::string& names, const Words& options) const {
    const std::string script = "export LISTEN_PID=$$ LISTEN_FDS=2 LISTEN_FDNAMES=" + names +
                               "; exec \"$@\" 3<&" + std::to_string(first.get()) + " 4<&" +
                               std::to_string(second.get());
    return joined({"/bin/bash", "-c", script, "bash"}, daemon({}, options));
  }

  tests::TemporaryDirectory directory_;
  std::filesystem::path recording_ = path() / "recording";
  std::filesystem::path pose_ = path() / "pose.sock";
  std::filesystem::path control_ = path() / "ctl.sock";
  NotifySocket manager_{path() / "notify"};
};

/// The kernel's numbers of the process's threads of that name. A thread's pools have its name as
/// well.
inline std::vector<pid_t> find_threads(pid_t process, const std::string& name) {
  const auto tasks = std::filesystem::path{"/proc"} / std::to_string(process) / "task";
  std::vector<pid_t> threads;
  for (const auto& task : std::filesystem::directory_iterator{tasks}) {
    std::ifstream file{task.path() / "comm"};
    std::string found;
    std::getline(file, found);
    if (found == name) {
      threads.push_back(static_cast<pid_t>(std::stol(task.path().filename())));
    }
  }
  return threads;
}

}  // namespace geoflow::daemon
