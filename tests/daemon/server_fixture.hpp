#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "tests/support/data.hpp"

#include "protocol/control_request.hpp"
#include "server/control_connection.hpp"
#include "server/control_server.hpp"
#include "server/event_loop.hpp"
#include "server/listening_socket.hpp"
#include "server/pose_server.hpp"

namespace geoflow::daemon {

/// Both servers on a loop in a thread of their own; work is handed to that thread.
class ServerTest : public testing::Test {
 protected:
  void SetUp() override {
    config_.pose = directory_.path() / "pose.sock";
    config_.control = directory_.path() / "ctl.sock";
    config_.handshake_timeout = std::chrono::milliseconds{100};
    config_.stall_timeout = std::chrono::milliseconds{300};
    config_.clients = 4;
    loop_ = EventLoop::create().value();
    poses_ = PoseServer::create(*loop_, config_, GEOFLOW_CLOCK_REPLAY).value();
    control_ = ControlServer::create(*loop_, config_,
                                     {.status = [] { return nlohmann::json{{"state", "fine"}}; },
                                      .config = [] { return nlohmann::json{{"map.file", "\"\""}}; },
                                      .change =
                                          [this](const ChangeRequest& request, const Asker& asker) {
                                            changes_.emplace_back(request.change, asker);
                                          }})
                   .value();
    ASSERT_TRUE(loop_->add_timer(std::chrono::milliseconds{20}, [this] {
      poses_->check_timeouts();
      control_->check_timeouts();
    }));
    ASSERT_TRUE(loop_->add(work_bell_.get(), EPOLLIN, [this](std::uint32_t) {
      std::uint64_t count = 0;
      ASSERT_EQ(::read(work_bell_.get(), &count, sizeof count), static_cast<ssize_t>(sizeof count));
      work_();
    }));
    thread_ = std::thread{[this] { EXPECT_TRUE(loop_->run()); }};
  }
  void TearDown() override {
    on_loop([this] { loop_->stop(); });
    thread_.join();
  }

  /// Runs `work` on the loop's thread and waits for it.
  void on_loop(const std::function<void()>& work) {
    std::promise<void> done;
    work_ = [&] {
      work();
      done.set_value();
    };
    const std::uint64_t one = 1;
    ASSERT_EQ(::write(work_bell_.get(), &one, sizeof one), static_cast<ssize_t>(sizeof one));
    done.get_future().wait();
  }
  void publish(std::uint64_t frame) {
    on_loop([&] {
      geoflow_pose pose{};
      pose.frame = frame;
      poses_->publish(pose);
      control_->publish(pose);
    });
  }
  std::size_t clients() {
    std::size_t count = 0;
    on_loop([&] { count = poses_->client_count() + control_->client_count(); });
    return count;
  }
  bool eventually(const std::function<bool()>& condition) {
    const HostTime deadline = HostClock::now() + std::chrono::seconds{10};
    while (!condition()) {
      if (HostClock::now() > deadline) {
        return false;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{5});
    }
    return true;
  }

  [[nodiscard]] PoseClient connect() const {
    auto client = PoseClient::connect(config_.pose, {.name = "test"});
    EXPECT_TRUE(client) << client.error().message;
    return std::move(*client);
  }
  static std::optional<ReceivedPose> next(PoseClient& client) {
    const auto received = client.receive(std::chrono::seconds{5});
    if (!received || !std::holds_alternative<ReceivedPose>(*received)) {
      return std::nullopt;
    }
    return std::get<ReceivedPose>(*received);
  }
  static UniqueFd raw_socket(const std::filesystem::path& path, int type) {
    UniqueFd fd{::socket(AF_UNIX, type | SOCK_CLOEXEC, 0)};
    if (!fd) {
      ADD_FAILURE() << "no socket";
      return fd;
    }
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(&address.sun_path[0], path.c_str(), sizeof address.sun_path - 1);
    const void* generic = &address;
    EXPECT_EQ(::connect(fd.get(), static_cast<const sockaddr*>(generic), sizeof address), 0);
    const timeval timeout{.tv_sec = 5, .tv_usec = 0};
    ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    return fd;
  }

  tests::TemporaryDirectory directory_;
  SocketConfig config_;
  UniqueFd work_bell_{::eventfd(0, EFD_CLOEXEC)};
  std::function<void()> work_;
  std::unique_ptr<EventLoop> loop_;
  std::unique_ptr<PoseServer> poses_;
  std::unique_ptr<ControlServer> control_;
  std::vector<std::pair<Change, Asker>> changes_;  // that were asked for; the loop's
  std::thread thread_;
};

/// Reads lines from a stream socket.
class LineReader {
 public:
  explicit LineReader(int fd) : fd_{fd} {}
  std::optional<nlohmann::json> next() {
    while (true) {
      if (const std::size_t end = text_.find('\n'); end != std::string::npos) {
        auto value = nlohmann::json::parse(text_.substr(0, end));
        text_.erase(0, end + 1);
        return value;
      }
      std::array<char, 4096> buffer{};
      const ssize_t size = ::recv(fd_, buffer.data(), buffer.size(), 0);
      if (size <= 0) {
        return std::nullopt;
      }
      text_.append(buffer.data(), static_cast<std::size_t>(size));
    }
  }

 private:
  int fd_;
  std::string text_;
};

/// Whether `work`, in a process of another user's, says so. Only root can.
inline bool as_nobody(const std::function<bool()>& work) {
  constexpr uid_t kNobody = 65534;
  const pid_t child = ::fork();
  if (child == 0) {
    const bool changed =
        ::setgroups(0, nullptr) == 0 && ::setgid(kNobody) == 0 && ::setuid(kNobody) == 0;
    ::_exit(changed && work() ? 0 : 1);
  }
  int status = -1;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return status == 0;
}

inline void say(int fd, const std::string& text) {
  ASSERT_EQ(::send(fd, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
}

}  // namespace geoflow::daemon
