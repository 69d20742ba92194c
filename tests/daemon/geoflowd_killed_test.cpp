#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::milliseconds;

/// Whether a pose comes from the socket within a minute.
bool gives_a_pose(const std::filesystem::path& socket) {
  const HostTime end = HostClock::now() + std::chrono::minutes{1};
  while (HostClock::now() < end) {
    auto client = PoseClient::connect(socket, {.name = "test"});
    if (client) {
      const auto received = client->receive(std::chrono::minutes{1});
      return received && std::holds_alternative<ReceivedPose>(*received);
    }
    std::this_thread::sleep_for(milliseconds{2});
  }
  return false;
}

TEST(GeoflowdKilled, AtFiftyMomentsLeavesAWholeMapAndComesUpAgain) {
  constexpr int kKills = 50;
  constexpr int kLongestLifeMs = 400;
  const tests::TemporaryDirectory folder;
  const auto recording = folder.path() / "recording";
  const auto map = folder.path() / "map";
  const auto socket = folder.path() / "pose.sock";
  tests::write_synthetic_recording(recording, {.frames = 60});
  // The map is saved all the time, so that many a kill meets a save.
  const std::vector<std::string> command = {GEOFLOWD_PROGRAM,
                                            "--replay",
                                            recording.string(),
                                            "--loop",
                                            "--pose-socket",
                                            socket.string(),
                                            "--set",
                                            "map.save_interval_s=0.01",
                                            "--set",
                                            "map.file=" + map.string(),
                                            "--control-socket",
                                            ""};
  const std::uint64_t seed = tests::test_seed(17);
  std::mt19937_64 random{seed};
  std::uniform_int_distribution<int> life_ms{0, kLongestLifeMs};
  int maps = 0;
  for (int kill = 0; kill < kKills; ++kill) {
    tests::Process daemon{command, folder.path() / "daemon"};
    if (kill % 10 == 9) {  // what was left is fit to go on with
      ASSERT_TRUE(gives_a_pose(socket)) << kill << ": " << daemon.err();
    }
    std::this_thread::sleep_for(milliseconds{life_ms(random)});
    daemon.send_signal(SIGKILL);
    ASSERT_EQ(daemon.wait(std::chrono::minutes{1}), 128 + SIGKILL) << daemon.err();
    if (std::filesystem::exists(map)) {
      const auto read = slam::load_map(map);
      ASSERT_TRUE(read) << "kill " << kill << ", seed " << seed << ": " << read.error().message;
      ASSERT_TRUE(slam::check_depth(**read)) << "kill " << kill << ", seed " << seed;
      ++maps;
    }
  }
  EXPECT_GT(maps, kKills / 5);
}

}  // namespace
}  // namespace geoflow::daemon
