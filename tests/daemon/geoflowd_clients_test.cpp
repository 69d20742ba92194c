#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "tests/support/data.hpp"

#include "bench/client_load.hpp"
#include "process.hpp"
#include "synthetic_recording.hpp"

// The daemon itself among clients that mean it no good.

namespace geoflow::daemon {
namespace {

constexpr Duration kPatience = std::chrono::seconds{60};

class GeoflowdClients : public testing::Test {
 protected:
  void SetUp() override {
    const auto recording = folder_.path() / "recording";
    tests::write_synthetic_recording(recording, {});
    daemon_.emplace(
        std::vector<std::string>{GEOFLOWD_PROGRAM, "--loop", "--replay", recording.string(),
                                 "--pose-socket", socket_.string(), "--control-socket", "", "--set",
                                 "socket.clients=64", "--set", "socket.clients_per_user=64"},
        folder_.path() / "daemon");
    ASSERT_TRUE(eventually([this] {
      auto connected = PoseClient::connect(socket_, {.name = "good"});
      if (connected) {
        good_.emplace(*std::move(connected));
      }
      return good_.has_value();
    })) << daemon_->err();
    ASSERT_TRUE(sees_poses(1));
  }

  static bool eventually(const std::function<bool()>& condition) {
    const HostTime end = HostClock::now() + kPatience;
    while (!condition() && HostClock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    }
    return condition();
  }
  /// Whether the good client gets `count` further poses that are tracked.
  bool sees_poses(int count) {
    while (count > 0) {
      const auto received = good_->receive(kPatience);
      if (!received || !std::holds_alternative<ReceivedPose>(*received)) {
        return false;
      }
      const geoflow_pose& pose = std::get<ReceivedPose>(*received).pose;
      count -= pose.status == GEOFLOW_TRACKING ? 1 : 0;
    }
    return true;
  }
  /// The daemon's descriptors.
  [[nodiscard]] std::vector<int> descriptors() const {
    std::vector<int> open;
    const auto folder = "/proc/" + std::to_string(daemon_->pid()) + "/fd";
    for (const auto& entry : std::filesystem::directory_iterator{folder}) {
      open.push_back(std::stoi(entry.path().filename()));
    }
    return open;
  }

  tests::TemporaryDirectory folder_;
  std::filesystem::path socket_ = folder_.path() / "pose.sock";
  std::optional<tests::Process> daemon_;
  std::optional<PoseClient> good_;
};

TEST_F(GeoflowdClients, SixtyThreeOfWhichSomeAreHostileChangeNothingForTheGoodOne) {
  const std::size_t before = descriptors().size();
  {
    const tools::ClientLoad load{{.socket = socket_, .readers = 39}};
    EXPECT_TRUE(eventually([&] {
      return sees_poses(1) && load.garbage() > 10'000 && load.records() > 1000;
    })) << load.garbage()
        << " " << load.records();
    EXPECT_TRUE(sees_poses(30));
  }
  // A recording that is opened anew has a descriptor or two for a moment.
  EXPECT_TRUE(eventually([&] { return descriptors().size() <= before; })) << descriptors().size();
  EXPECT_TRUE(sees_poses(1));
}

TEST_F(GeoflowdClients, OutOfDescriptorsItServesThoseWhoAreThere) {
  rlimit usual{};
  ASSERT_EQ(::prlimit(daemon_->pid(), RLIMIT_NOFILE, nullptr, &usual), 0);
  const std::vector<int> open = descriptors();
  rlim_t lowest_free = 0;
  while (std::ranges::find(open, static_cast<int>(lowest_free)) != open.end()) {
    ++lowest_free;
  }
  // Two clients more, beside those descriptors that are kept for the daemon's own work: the
  // recording's images, each of which is opened while the test lasts, and its beginning again.
  constexpr rlim_t kReserved = 16;
  const rlimit tight{.rlim_cur = lowest_free + 2 + kReserved, .rlim_max = usual.rlim_max};
  ASSERT_EQ(::prlimit(daemon_->pid(), RLIMIT_NOFILE, &tight, nullptr), 0);
  std::string why;
  std::vector<PoseClient> inside;
  ASSERT_TRUE(eventually([&] {
    auto client = PoseClient::connect(socket_, {.name = "further"});
    if (!client) {
      why = client.error().message;
      return true;
    }
    inside.push_back(*std::move(client));
    return false;
  }));
  EXPECT_LE(inside.size(), 4U);  // files may be open while descriptors are counted
  EXPECT_TRUE(eventually([this] {
    return daemon_->err().find("out of file descriptors") != std::string::npos;
  })) << why
      << "; " << daemon_->err();
  EXPECT_TRUE(sees_poses(45));  // once through the recording and on
  ASSERT_EQ(::prlimit(daemon_->pid(), RLIMIT_NOFILE, &usual, nullptr), 0);
  EXPECT_TRUE(PoseClient::connect(socket_, {.name = "later"}));
}

TEST_F(GeoflowdClients, DescriptorsThatAClientPushesAreClosed) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  const UniqueFd read_end{ends[0]};
  UniqueFd write_end{ends[1]};
  const UniqueFd pusher = tools::connect_to_poses(socket_);
  ASSERT_TRUE(pusher);
  geoflow_hello hello{};
  hello.client_major = GEOFLOW_PROTOCOL_MAJOR;
  auto record = encode_record(GEOFLOW_HELLO, 0, 0, hello);
  iovec bytes{.iov_base = record.data(), .iov_len = record.size()};
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &bytes;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* const rights = CMSG_FIRSTHDR(&message);
  rights->cmsg_level = SOL_SOCKET;
  rights->cmsg_type = SCM_RIGHTS;
  rights->cmsg_len = CMSG_LEN(sizeof(int));
  const int pushed = write_end.get();
  std::memcpy(CMSG_DATA(rights), &pushed, sizeof pushed);
  ASSERT_GT(::sendmsg(pusher.get(), &message, MSG_NOSIGNAL), 0);
  write_end.reset();
  // The daemon had the only other copy: the pipe ends when that is closed, the connection being
  // open.
  std::byte nothing{};
  EXPECT_EQ(::read(read_end.get(), &nothing, 1), 0);
  EXPECT_TRUE(sees_poses(1));
}

TEST(BenchClients, TellsTheDaemonsTimesAloneAndAmongClients) {
  const tests::TemporaryDirectory folder;
  const auto recording = folder.path() / "recording";
  tests::write_synthetic_recording(recording, {.frames = 60});
  const auto bench = tests::run_process(
      {GEOFLOW_PROGRAM, "bench", "clients", recording.string(), "--runs", "1", "--json"},
      folder.path() / "bench");
  ASSERT_EQ(bench.code, 0) << bench.err;
  const auto rows = nlohmann::json::parse(bench.out)["rows"];
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0]["records_read"], 0);
  EXPECT_TRUE(rows[0]["p99_ratio"].is_null());
  EXPECT_GT(rows[1]["records_read"], 0);
  EXPECT_GT(rows[1]["garbage_sent"], 0);
  EXPECT_DOUBLE_EQ(rows[1]["p99_ratio"], rows[1]["process_p99_ms"].get<double>() /
                                             rows[0]["process_p99_ms"].get<double>());
}

}  // namespace
}  // namespace geoflow::daemon
