#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;
using tests::Process;
using tests::run_process;

/// The programs themselves, on a synthetic recording, with sockets in a temporary folder.
class GeoflowdTest : public testing::Test {
 protected:
  void SetUp() override { tests::write_synthetic_recording(recording_, {}); }

  std::vector<std::string> daemon(std::vector<std::string> extra) {
    std::vector<std::string> arguments = {
        GEOFLOWD_PROGRAM, "--replay",         recording_.string(),           "--pose-socket",
        pose_.string(),   "--control-socket", (path() / "ctl.sock").string()};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    return arguments;
  }
  [[nodiscard]] const std::filesystem::path& path() const { return directory_.path(); }
  [[nodiscard]] std::filesystem::path log(const std::string& name) const {
    return directory_.path() / name;
  }

  PoseClient connect_when_up() {
    const HostTime deadline = HostClock::now() + seconds{60};
    while (true) {
      auto client = PoseClient::connect(pose_, {.name = "test"});
      if (client) {
        return std::move(*client);
      }
      if (HostClock::now() > deadline) {
        throw std::runtime_error{client.error().message};
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{5});
    }
  }

  tests::TemporaryDirectory directory_;
  std::filesystem::path recording_ = directory_.path() / "recording";
  std::filesystem::path pose_ = directory_.path() / "pose.sock";
};

TEST_F(GeoflowdTest, AFastReplayGivesTheLastPoseThenTheEndAndExitsZero) {
  Process process{daemon({"--fast"}), log("daemon")};
  PoseClient client = connect_when_up();
  geoflow_pose last{};
  std::uint64_t poses = 0;
  std::uint32_t reason = 0;
  while (reason == 0) {
    const auto received = client.receive(seconds{60});
    ASSERT_TRUE(received) << received.error().message;
    if (const auto* pose = std::get_if<ReceivedPose>(&*received)) {
      last = pose->pose;
      ++poses;
    } else if (const auto* end = std::get_if<PoseClient::Ended>(&*received)) {
      ASSERT_NE(end->reason, 0U);
      reason = end->reason;
    } else {
      FAIL() << "no pose for a minute";
    }
  }
  EXPECT_GT(poses, 0U);
  EXPECT_EQ(last.frame, 29U);
  EXPECT_EQ(last.status, GEOFLOW_TRACKING);
  EXPECT_EQ(last.t_recording_ns, 1000966667000);
  EXPECT_EQ(reason, static_cast<std::uint32_t>(GEOFLOW_END_REPLAYED));
  EXPECT_EQ(process.wait(seconds{20}), 0) << process.err();
  EXPECT_FALSE(std::filesystem::exists(pose_));
}

TEST_F(GeoflowdTest, SigtermStopsALoopingReplayAndSighupDoesNot) {
  Process process{daemon({"--realtime", "--loop"}), log("daemon")};
  PoseClient client = connect_when_up();
  std::uint32_t resets = 0;
  bool hung_up = false;
  std::int64_t last_capture_ns = 0;
  while (resets == 0 || !hung_up) {
    const auto received = client.receive(seconds{60});
    ASSERT_TRUE(received && std::holds_alternative<ReceivedPose>(*received));
    const geoflow_pose& pose = std::get<ReceivedPose>(*received).pose;
    EXPECT_GT(pose.t_capture_ns, last_capture_ns);  // also from one loop to the next
    EXPECT_GE(pose.t_publish_ns, pose.t_arrival_ns);
    last_capture_ns = pose.t_capture_ns;
    resets = pose.reset_counter;
    if (!hung_up && pose.frame >= 3) {  // a slow client may not see each frame
      process.send_signal(SIGHUP);
      hung_up = true;
    }
  }
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(seconds{20}), 0) << process.err();
  EXPECT_THAT(process.err(), HasSubstr("reloaded"));
  EXPECT_FALSE(std::filesystem::exists(pose_));
  while (true) {
    const auto received = client.receive(seconds{5});
    ASSERT_TRUE(received);
    if (const auto* end = std::get_if<PoseClient::Ended>(&*received)) {
      EXPECT_EQ(end->reason, static_cast<std::uint32_t>(GEOFLOW_END_STOPPED));
      break;
    }
  }
}

TEST_F(GeoflowdTest, ExitCodesSayWhatWasWrong) {
  EXPECT_EQ(run_process({GEOFLOWD_PROGRAM, "--help"}, log("help")).code, 0);
  EXPECT_EQ(run_process({GEOFLOWD_PROGRAM, "--no-such"}, log("usage")).code, 2);
  EXPECT_EQ(run_process({GEOFLOWD_PROGRAM, "--pose-socket", pose_.string(), "--control-socket", ""},
                        log("none"))
                .code,
            2);
  const auto key = run_process(daemon({"--set", "slam.nonsense=1"}), log("key"));
  EXPECT_EQ(key.code, 2);
  EXPECT_THAT(key.err, HasSubstr("slam.nonsense"));
  std::ofstream{log("bad.toml")} << "[socket]\nclients = 0\n";
  const auto file = run_process(daemon({"--config", log("bad.toml").string()}), log("file"));
  EXPECT_EQ(file.code, 2);
  EXPECT_THAT(file.err, HasSubstr("bad.toml:2: socket.clients"));
  EXPECT_EQ(run_process({GEOFLOWD_PROGRAM, "--replay", log("nothing").string(), "--pose-socket", "",
                         "--control-socket", ""},
                        log("missing"))
                .code,
            3);
}

TEST_F(GeoflowdTest, ASecondDaemonExitsFourAndTheFirstGoesOn) {
  Process first{daemon({"--loop"}), log("first")};
  PoseClient client = connect_when_up();
  const auto second = run_process(daemon({}), log("second"));
  EXPECT_EQ(second.code, 4);
  EXPECT_THAT(second.err, HasSubstr("another daemon"));
  EXPECT_TRUE(client.receive(seconds{60}));
  first.send_signal(SIGINT);
  EXPECT_EQ(first.wait(seconds{20}), 0) << first.err();
}

TEST_F(GeoflowdTest, TheVerbsReplayPoseRecordAndInfoWorkTogether) {
  const std::string out = log("out").string();
  const auto replayed = run_process(
      {GEOFLOW_PROGRAM, "replay", recording_.string(), "-o", out, "--json"}, log("replay"));
  ASSERT_EQ(replayed.code, 0) << replayed.err;
  const auto report = nlohmann::json::parse(replayed.out);
  EXPECT_EQ(report["frames"], 30);
  EXPECT_EQ(report["tracked"], 30);
  for (const char* name :
       {"live_camera.txt", "live_base.txt", "final_camera.txt", "final_base.txt", "report.json"}) {
    EXPECT_TRUE(std::filesystem::exists(log("out") / name)) << name;
  }

  const std::string bag = log("bag").string();
  const auto recorded = run_process(
      {GEOFLOW_PROGRAM, "record", "--from", recording_.string(), "-o", bag}, log("record"));
  ASSERT_EQ(recorded.code, 0) << recorded.err;
  const auto info = run_process({GEOFLOW_PROGRAM, "info", bag, "--json"}, log("info"));
  ASSERT_EQ(info.code, 0) << info.err;
  EXPECT_EQ(nlohmann::json::parse(info.out)["format"], "rosbag2");
  const std::string again = log("again").string();
  ASSERT_EQ(run_process({GEOFLOW_PROGRAM, "replay", bag, "-o", again}, log("replay2")).code, 0);
  const auto read = [](const std::filesystem::path& file) {
    std::ifstream stream{file};
    return std::string{std::istreambuf_iterator<char>{stream}, {}};
  };
  EXPECT_EQ(read(log("again") / "final_camera.txt"), read(log("out") / "final_camera.txt"));

  EXPECT_EQ(
      run_process({GEOFLOW_PROGRAM, "pose", "--socket", pose_.string(), "--once"}, log("nobody"))
          .code,
      4);
  const Process process{daemon({"--loop"}), log("daemon")};
  connect_when_up();
  const auto pose = run_process(
      {GEOFLOW_PROGRAM, "pose", "--socket", pose_.string(), "--once", "--json"}, log("pose"));
  ASSERT_EQ(pose.code, 0) << pose.err;
  EXPECT_EQ(nlohmann::json::parse(pose.out)["replay"], true);
}

TEST_F(GeoflowdTest, AnInterruptedReplayWritesWhatItHas) {
  tests::write_synthetic_recording(recording_, {.frames = 400, .width = 640, .height = 480});
  Process process{{GEOFLOW_PROGRAM, "replay", recording_.string(), "-o", log("out").string()},
                  log("replay")};
  while (!std::filesystem::exists(log("out"))) {  // made once signals are handled
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  std::this_thread::sleep_for(std::chrono::milliseconds{100});
  process.send_signal(SIGINT);
  EXPECT_EQ(process.wait(seconds{60}), 130) << process.err();
  std::ifstream stream{log("out") / "report.json"};
  const auto report = nlohmann::json::parse(stream);
  EXPECT_EQ(report["interrupted"], true);
  EXPECT_LT(report["frames"].get<int>(), 400);
}

}  // namespace
}  // namespace geoflow::daemon
