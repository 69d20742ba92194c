#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <sys/stat.h>
#include <sys/types.h>
#include <sys/un.h>
#include <unistd.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "tests/support/data.hpp"

#include "server/event_loop.hpp"
#include "server/listening_socket.hpp"
#include "server_fixture.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

TEST_F(ServerTest, AClientIsWelcomedAndGetsEveryPose) {
  PoseClient client = connect();
  EXPECT_EQ(client.welcome().major, GEOFLOW_PROTOCOL_MAJOR);
  EXPECT_EQ(client.welcome().max_clients, 4U);
  EXPECT_EQ(client.welcome().clock_flags, static_cast<std::uint32_t>(GEOFLOW_CLOCK_REPLAY));
  for (std::uint64_t frame = 0; frame < 50; ++frame) {
    publish(frame);
    const auto received = next(client);
    ASSERT_TRUE(received);
    EXPECT_EQ(received->pose.frame, frame);
    EXPECT_EQ(received->dropped, 0U);
  }
}

TEST_F(ServerTest, ALateClientIsGreetedWithTheNewestPose) {
  publish(41);
  publish(42);
  PoseClient client = connect();
  EXPECT_EQ(next(client)->pose.frame, 42U);
}

TEST_F(ServerTest, PropagatedPosesGoToThoseWhoAskForThem) {
  auto asks = PoseClient::connect(config_.pose, {.name = "test", .propagated = true});
  ASSERT_TRUE(asks) << asks.error().message;
  PoseClient frames_only = connect();
  const auto publish_at = [&](std::int64_t t_capture_ns, std::int64_t t_frame_ns) {
    on_loop([&] {
      geoflow_pose pose{};
      pose.t_capture_ns = t_capture_ns;
      pose.t_frame_ns = t_frame_ns;
      poses_->publish(pose);
    });
  };
  publish_at(10, 10);  // nothing is propagated yet: the frame is the newest there is
  publish_at(15, 10);
  publish_at(20, 10);
  publish_at(13, 13);  // older than what was carried on to 20
  publish_at(25, 13);
  publish_at(30, 30);
  for (const std::int64_t t_capture_ns : {10, 15, 20, 25, 30}) {
    EXPECT_EQ(next(*asks)->pose.t_capture_ns, t_capture_ns);
  }
  for (const std::int64_t t_capture_ns : {10, 13, 30}) {
    EXPECT_EQ(next(frames_only)->pose.t_capture_ns, t_capture_ns);
  }
  PoseClient late = connect();
  EXPECT_EQ(next(late)->pose.t_capture_ns, 30);
}

TEST_F(ServerTest, ASlowClientGetsTheNewestPoseAndTheCountOfMissedOnes) {
  config_.stall_timeout = seconds{60};
  PoseClient slow = connect();
  constexpr std::uint64_t kFrames = 200;
  for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
    publish(frame);
  }
  std::uint64_t seen = 0;
  std::uint64_t missed = 0;
  std::uint64_t last = 0;
  while (last + 1 < kFrames) {
    const auto received = next(slow);
    ASSERT_TRUE(received);
    ++seen;
    missed += received->dropped;
    last = received->pose.frame;
  }
  EXPECT_EQ(seen + missed, kFrames);
  EXPECT_LT(seen, 40U);  // the kernel's buffer and the one that waits
}

TEST_F(ServerTest, AClientThatReadsNothingIsCutOff) {
  const PoseClient dead = connect();
  EXPECT_EQ(clients(), 1U);
  for (std::uint64_t frame = 0; frame < 100; ++frame) {
    publish(frame);
  }
  EXPECT_TRUE(eventually([this] { return clients() == 0; }));
}

TEST_F(ServerTest, AClientWithoutHelloIsRefusedInTime) {
  const UniqueFd silent = raw_socket(config_.pose, SOCK_SEQPACKET);
  std::array<std::byte, 4096> buffer{};
  const ssize_t size = ::recv(silent.get(), buffer.data(), buffer.size(), 0);
  ASSERT_GT(size, 0);
  const auto record = parse_record(std::span{buffer}.first(static_cast<std::size_t>(size)));
  ASSERT_TRUE(record);
  EXPECT_EQ(record->header.type, GEOFLOW_REFUSE);
  EXPECT_EQ(read_payload<geoflow_refuse>(record->payload).reason,
            static_cast<std::uint32_t>(GEOFLOW_REFUSE_TIMEOUT));
  EXPECT_EQ(::recv(silent.get(), buffer.data(), buffer.size(), 0), 0);
}

TEST_F(ServerTest, GarbageIsRefusedWithAReason) {
  const UniqueFd fd = raw_socket(config_.pose, SOCK_SEQPACKET);
  say(fd.get(), "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
  std::array<std::byte, 4096> buffer{};
  const ssize_t size = ::recv(fd.get(), buffer.data(), buffer.size(), 0);
  ASSERT_GT(size, 0);
  const auto record = parse_record(std::span{buffer}.first(static_cast<std::size_t>(size)));
  ASSERT_TRUE(record);
  const auto refuse = read_payload<geoflow_refuse>(record->payload);
  EXPECT_EQ(refuse.reason, static_cast<std::uint32_t>(GEOFLOW_REFUSE_MALFORMED));
  EXPECT_THAT(std::string{&refuse.text[0]}, HasSubstr("magic"));
}

TEST_F(ServerTest, TooManyClientsAreRefusedAndThoseThereAreServed) {
  std::vector<PoseClient> inside;
  inside.reserve(static_cast<std::size_t>(config_.clients));
  for (int i = 0; i < config_.clients; ++i) {
    inside.push_back(connect());
  }
  const auto outside = PoseClient::connect(config_.pose, {.name = "one too many"});
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(outside.error().message, HasSubstr("too many clients"));
  publish(1);
  for (PoseClient& client : inside) {
    EXPECT_EQ(next(client)->pose.frame, 1U);
  }
  inside.pop_back();
  EXPECT_TRUE(eventually([&] { return clients() == 3; }));
  static_cast<void>(connect());
}

TEST_F(ServerTest, OneUserDoesNotTakeTheRoomOfOthers) {
  config_.clients_per_user = 2;
  on_loop([this] {
    poses_->set_limits(config_);
    control_->set_limits(config_);
  });
  PoseClient first = connect();
  const PoseClient second = connect();
  const auto third = PoseClient::connect(config_.pose, {.name = "third"});
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().code, ErrorCode::kUnavailable);
  const std::string user = std::to_string(::geteuid());
  EXPECT_THAT(third.error().message, HasSubstr("too many clients of user " + user));
  const std::array controls = {raw_socket(config_.control, SOCK_STREAM),
                               raw_socket(config_.control, SOCK_STREAM),
                               raw_socket(config_.control, SOCK_STREAM)};
  EXPECT_TRUE(LineReader{controls[0].get()}.next()->contains("hello"));
  EXPECT_EQ((*LineReader{controls[2].get()}.next())["error"]["message"],
            "too many clients of user " + user);
  publish(3);
  EXPECT_EQ(next(first)->pose.frame, 3U);
  if (::geteuid() == 0) {
    ::chmod(config_.pose.c_str(), 0666);
    ::chmod(directory_.path().c_str(), 0755);
    EXPECT_TRUE(as_nobody([this] {
      return PoseClient::connect(config_.pose, {.name = "another user"}).has_value();
    }));
  }
}

TEST_F(ServerTest, AFloodingClientIsCutOffAndOthersAreServed) {
  PoseClient good = connect();
  const UniqueFd flood = raw_socket(config_.pose, SOCK_SEQPACKET);
  const geoflow_hello hello{};
  const auto bytes = encode_record(GEOFLOW_HELLO, 0, 0, hello);
  ssize_t sent = 1;
  for (int i = 0; i < 100000 && sent > 0; ++i) {
    sent = ::send(flood.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  EXPECT_LE(sent, 0);
  publish(5);
  EXPECT_EQ(next(good)->pose.frame, 5U);
}

TEST_F(ServerTest, FinishGivesTheLastPoseAndTheEnd) {
  PoseClient client = connect();
  publish(9);
  on_loop([this] { poses_->finish(GEOFLOW_END_REPLAYED); });
  EXPECT_EQ(next(client)->pose.frame, 9U);
  const auto end = client.receive(seconds{5});
  ASSERT_TRUE(end);
  EXPECT_EQ(std::get<PoseClient::Ended>(*end).reason,
            static_cast<std::uint32_t>(GEOFLOW_END_REPLAYED));
  EXPECT_EQ(clients(), 0U);
}

TEST_F(ServerTest, DisconnectsAtAnyMomentLeaveNothingBehind) {
  for (int i = 0; i < 50; ++i) {
    PoseClient client = connect();
    publish(static_cast<std::uint64_t>(i));
    if (i % 2 == 0) {
      EXPECT_TRUE(next(client));
    }
  }
  EXPECT_TRUE(eventually([this] { return clients() == 0; }));
}

TEST_F(ServerTest, RateLimitThinsTheStream) {
  auto client = PoseClient::connect(config_.pose, {.name = "slow", .max_rate_hz = 1});
  ASSERT_TRUE(client);
  for (std::uint64_t frame = 0; frame < 20; ++frame) {
    publish(frame);
  }
  const auto first = next(*client);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->pose.frame, 0U);
  EXPECT_TRUE(std::holds_alternative<PoseClient::TimedOut>(*client->receive(milliseconds{50})));
}

TEST_F(ServerTest, ASecondDaemonIsRefusedWithThePid) {
  auto second_loop = EventLoop::create().value();
  const auto second = PoseServer::create(*second_loop, config_, 0);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().message, HasSubstr(std::to_string(::getpid())));
  const PoseClient client = connect();  // the first one is unharmed
}

TEST(ListeningSocketTest, AStaleSocketIsReplacedAndAnythingElseIsNot) {
  const tests::TemporaryDirectory directory;
  const auto path = directory.path() / "pose.sock";
  {
    const UniqueFd stale{::socket(AF_UNIX, SOCK_SEQPACKET, 0)};
    ASSERT_TRUE(stale);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(&address.sun_path[0], path.c_str(), sizeof address.sun_path - 1);
    const void* generic = &address;
    ASSERT_EQ(::bind(stale.get(), static_cast<const sockaddr*>(generic), sizeof address), 0);
  }
  {
    const auto socket =
        ListeningSocket::open({.path = path, .type = SOCK_SEQPACKET, .mode = 0600, .group = {}});
    ASSERT_TRUE(socket) << socket.error().message;
    struct stat status{};
    ASSERT_EQ(::stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0600U);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
  std::ofstream{path} << "precious";
  const auto refused =
      ListeningSocket::open({.path = path, .type = SOCK_SEQPACKET, .mode = 0600, .group = {}});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("not a socket"));
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(ListeningSocketTest, BadPathsAndGroupsAreErrors) {
  const tests::TemporaryDirectory directory;
  const auto open = [](const std::filesystem::path& path, const std::string& group) {
    return ListeningSocket::open({.path = path, .type = SOCK_STREAM, .mode = 0600, .group = group});
  };
  EXPECT_THAT(open(std::string(200, 'x'), "").error().message, HasSubstr("at most"));
  EXPECT_EQ(open(directory.path() / "no" / "such.sock", "").error().code, ErrorCode::kNotFound);
  EXPECT_THAT(open(directory.path() / "a.sock", "no-such-group").error().message,
              HasSubstr("no-such-group"));
}

TEST(PoseClientTest, NoDaemonIsUnavailable) {
  const tests::TemporaryDirectory directory;
  const auto client = PoseClient::connect(directory.path() / "pose.sock", {.name = "test"});
  ASSERT_FALSE(client);
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace geoflow::daemon
