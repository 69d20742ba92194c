#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <sys/stat.h>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

using nlohmann::json;
using std::chrono::seconds;
using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using tests::Process;

constexpr auto kPatience = seconds{60};
constexpr auto kBetweenRequests = std::chrono::milliseconds{30};  // 50 a second are allowed

/// The daemon with a map, on a synthetic recording over and over.
class GeoflowdMapTest : public testing::Test {
 protected:
  /// Long enough that it seldom begins again within a test.
  static void SetUpTestSuite() {
    shared_ = std::make_unique<tests::TemporaryDirectory>();
    tests::write_synthetic_recording(shared_->path() / "recording", {.frames = 300});
  }
  static void TearDownTestSuite() { shared_.reset(); }

  [[nodiscard]] const std::filesystem::path& path() const { return directory_.path(); }
  [[nodiscard]] std::vector<std::string> daemon(const std::vector<std::string>& extra) const {
    std::vector<std::string> words = {GEOFLOWD_PROGRAM,   "--replay",       recording_.string(),
                                      "--loop",           "--pose-socket",  pose_.string(),
                                      "--control-socket", control_.string()};
    words.insert(words.end(), extra.begin(), extra.end());
    return words;
  }
  [[nodiscard]] std::vector<std::string> daemon_with_map(std::vector<std::string> extra) const {
    extra.insert(extra.end(), {"--set", "map.file=\"" + map_.string() + "\""});
    return daemon(extra);
  }

  static void wait_until(const std::function<bool()>& condition, const std::string& what) {
    const HostTime deadline = HostClock::now() + kPatience;
    while (!condition()) {
      if (HostClock::now() > deadline) {
        throw std::runtime_error{"not in a minute: " + what};
      }
      std::this_thread::sleep_for(kBetweenRequests);
    }
  }
  [[nodiscard]] ControlClient connect() const {
    wait_until([&] { return ControlClient::connect(control_).has_value(); }, "control socket");
    return ControlClient::connect(control_).value();
  }
  static json ask(ControlClient& client, const json& request) {
    auto reply = client.request(request, kPatience);
    return reply ? *reply : json{{"failed", reply.error().message}};
  }
  static json load(ControlClient& client, const std::filesystem::path& file) {
    return ask(client, {{"cmd", "map"}, {"do", "load"}, {"file", file.string()}});
  }
  static json status(ControlClient& client) {
    return ask(client, {{"cmd", "status"}}).value("status", json::object());
  }
  /// Until the run has made a map worth saving.
  static void wait_for_mapping(ControlClient& client) {
    wait_until([&] { return status(client).value("mapping_runs", 0) > 2; }, "mapping");
  }
  [[nodiscard]] static std::size_t keyframes(const std::filesystem::path& file) {
    const auto map = slam::load_map(file);
    if (!map || !slam::check_depth(**map)) {
      ADD_FAILURE() << file;
      return 0;
    }
    return slam::summary(**map).keyframes;
  }

  static inline std::unique_ptr<tests::TemporaryDirectory> shared_;
  tests::TemporaryDirectory directory_;
  std::filesystem::path recording_ = shared_->path() / "recording";
  std::filesystem::path pose_ = path() / "pose.sock";
  std::filesystem::path control_ = path() / "ctl.sock";
  std::filesystem::path map_ = path() / "test.map";
};

TEST_F(GeoflowdMapTest, IsSavedOnDemandWhileTrackingGoesOn) {
  Process process{daemon_with_map({"--set", "map.save_interval_s=0"}), path() / "log"};
  ControlClient client = connect();
  wait_for_mapping(client);
  EXPECT_TRUE(status(client)["map"]["saved_s"].is_null());
  for (int i = 0; i < 5; ++i) {
    const auto frames = status(client)["frames"].get<std::uint64_t>();
    const json reply = ask(client, {{"cmd", "map"}, {"do", "save"}});
    EXPECT_EQ(reply["saved"], map_.string()) << reply;
    EXPECT_GT(reply["keyframes"], 0);
    EXPECT_EQ(keyframes(map_), reply["keyframes"]);
    EXPECT_EQ(std::filesystem::file_size(map_), reply["bytes"]);
    wait_until([&] { return status(client)["frames"] != frames; }, "a further frame");
  }
  EXPECT_EQ(status(client)["map"]["trouble"], "");
  EXPECT_GE(status(client)["map"]["saved_s"], 0.0);
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(kPatience), 0) << process.err();
}

TEST_F(GeoflowdMapTest, IsSavedByTheClockWhileItChanges) {
  Process process{daemon_with_map({"--set", "map.save_interval_s=0.2"}), path() / "log"};
  ControlClient client = connect();
  wait_until([&] { return std::filesystem::exists(map_); }, "the first map");
  EXPECT_GT(keyframes(map_), 0U);
  process.send_signal(SIGKILL);
  (void)process.wait(kPatience);
  EXPECT_GT(keyframes(map_), 0U);
}

TEST_F(GeoflowdMapTest, ARestartFindsItsPlaceInTheLastMap) {
  json last;
  const auto run_a_while = [&] {
    Process process{daemon_with_map({}), path() / "log"};
    ControlClient client = connect();
    wait_until(
        [&] {
          last = status(client);
          return last["by_status"].value("TRACKING", 0) > 20;
        },
        "tracking");
    process.send_signal(SIGTERM);
    EXPECT_EQ(process.wait(kPatience), 0) << process.err();
  };
  run_a_while();
  const std::size_t saved = keyframes(map_);
  EXPECT_GT(saved, 2U);
  run_a_while();
  EXPECT_GT(last["by_status"]["RELOCALISING"], 0);
  EXPECT_GT(keyframes(map_), saved);
  const auto map = slam::load_map(map_);
  ASSERT_TRUE(map);
  EXPECT_EQ(slam::summary(**map).parts, 1U);  // the second run's has been joined to the first one's
}

TEST_F(GeoflowdMapTest, AFullDiskLeavesTheOldMapAndTheDaemonGoesOn) {
  Process process{daemon_with_map({"--set", "map.save_interval_s=0"}), path() / "log"};
  ControlClient client = connect();
  wait_for_mapping(client);
  ASSERT_EQ(ask(client, {{"cmd", "map"}, {"do", "save"}})["saved"], map_.string());
  const std::size_t before = keyframes(map_);
  constexpr rlimit kNoRoom{.rlim_cur = 4096, .rlim_max = RLIM_INFINITY};
  ASSERT_EQ(::prlimit(process.pid(), RLIMIT_FSIZE, &kNoRoom, nullptr), 0);
  EXPECT_THAT(ask(client, {{"cmd", "map"}, {"do", "save"}}).value("failed", ""),
              HasSubstr("test.map"));
  EXPECT_EQ(keyframes(map_), before);
  EXPECT_THAT(status(client)["map"]["trouble"].get<std::string>(), HasSubstr("test.map"));
  constexpr rlimit kRoom{.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
  ASSERT_EQ(::prlimit(process.pid(), RLIMIT_FSIZE, &kRoom, nullptr), 0);
  EXPECT_EQ(ask(client, {{"cmd", "map"}, {"do", "save"}})["saved"], map_.string());
  EXPECT_EQ(status(client)["map"]["trouble"], "");
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(kPatience), 0) << process.err();
}

TEST_F(GeoflowdMapTest, AResetBeginsAnewInTheMapAndAMapResetWithoutOne) {
  Process process{daemon_with_map({"--set", "map.save_interval_s=0"}), path() / "log"};
  ControlClient client = connect();
  wait_for_mapping(client);
  ASSERT_EQ(ask(client, {{"cmd", "map"}, {"do", "save"}})["saved"], map_.string());
  ASSERT_EQ(ask(client, {{"cmd", "watch"}})["reply"], "watch");
  const auto next_pose = [&] {
    const auto line = client.next(kPatience);
    return line && *line ? (**line).value("pose", json::object()) : json::object();
  };
  const std::uint64_t resets = next_pose().value("reset_counter", std::uint64_t{0});
  const json reset = ask(client, {{"cmd", "reset"}});
  EXPECT_EQ(reset["reply"], "reset") << reset;
  EXPECT_GT(reset["keyframes"], 0);
  json pose = next_pose();
  wait_until([&] { return (pose = next_pose()).value("reset_counter", std::uint64_t{0}) > resets; },
             "a pose after the reset");
  // The first view may already be known again.
  EXPECT_THAT(pose.value("status", ""), AnyOf("RELOCALISING", "TRACKING"));
  wait_until([&] { return next_pose().value("status", "") == "TRACKING"; }, "its place in the map");

  const json forgotten = ask(client, {{"cmd", "map"}, {"do", "reset"}});
  EXPECT_EQ(forgotten["moved"], map_.string() + ".old") << forgotten;
  EXPECT_FALSE(std::filesystem::exists(map_));
  EXPECT_GT(keyframes(map_.string() + ".old"), 0U);
  wait_until([&] { return next_pose().value("status", "") == "TRACKING"; }, "a map of its own");
  EXPECT_EQ(ask(client, {{"cmd", "map"}, {"do", "save"}})["saved"], map_.string());
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(kPatience), 0) << process.err();
}

TEST_F(GeoflowdMapTest, ALoadGoesOnInAnotherFilesMapAndKeepsTheFormerOneAside) {
  const std::filesystem::path other = path() / "other.map";
  const std::filesystem::path aside = map_.string() + ".old";
  Process process{daemon_with_map({"--set", "map.save_interval_s=0"}), path() / "log"};
  ControlClient client = connect();
  wait_for_mapping(client);
  ASSERT_EQ(ask(client, {{"cmd", "map"}, {"do", "save"}})["saved"], map_.string());
  std::filesystem::rename(map_, other);
  const std::size_t saved = keyframes(other);
  const auto resets = status(client)["pose"]["reset_counter"].get<std::uint64_t>();

  const json loaded = load(client, other);
  EXPECT_EQ(loaded["loaded"], other.string()) << loaded;
  EXPECT_EQ(loaded["moved"], aside.string());
  EXPECT_EQ(loaded["keyframes"], saved);
  EXPECT_EQ(keyframes(map_), saved);
  EXPECT_EQ(keyframes(other), saved);
  const std::size_t former = keyframes(aside);  // as it was then, whether it had been saved or not
  EXPECT_GE(former, saved);
  wait_until([&] { return status(client)["pose"]["reset_counter"] > resets; }, "the new start");
  wait_until([&] { return status(client)["pose"]["status"] == "TRACKING"; },
             "its place in the map");

  // The way back.
  const json back = load(client, aside);
  EXPECT_EQ(back["keyframes"], former) << back;
  EXPECT_EQ(keyframes(map_), former);
  EXPECT_GE(keyframes(aside), saved);
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(kPatience), 0) << process.err();
  EXPECT_GE(keyframes(map_), former);
}

TEST_F(GeoflowdMapTest, AMapThatCannotBeLoadedIsRefusedWithTheReasonAndNothingChanges) {
  Process process{daemon_with_map({"--set", "map.save_interval_s=0"}), path() / "log"};
  ControlClient client = connect();
  wait_for_mapping(client);
  ASSERT_EQ(ask(client, {{"cmd", "map"}, {"do", "save"}})["saved"], map_.string());
  const auto written = std::filesystem::last_write_time(map_);
  const std::uint64_t resets = status(client)["pose"]["reset_counter"].get<std::uint64_t>();
  const auto refused = [&](const std::filesystem::path& file) {
    return load(client, file).value("failed", "");
  };
  EXPECT_THAT(refused(GEOFLOW_SMALL_MAP), HasSubstr("small.map: the map was made with"));

  const std::filesystem::path damaged = path() / "damaged.map";
  std::filesystem::copy(map_, damaged);
  {  // in the depth, which is not read with the rest
    std::fstream file{damaged, std::ios::in | std::ios::out | std::ios::binary};
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(damaged) - 1000));
    file << "damage";
  }
  EXPECT_THAT(refused(damaged), HasSubstr("damaged.map: section "));
  std::filesystem::resize_file(damaged, 1000);
  EXPECT_THAT(refused(damaged), HasSubstr("damaged.map"));
  ASSERT_EQ(::mkfifo((path() / "fifo").c_str(), 0600), 0);
  EXPECT_THAT(refused(path() / "fifo"), HasSubstr("not a regular file"));
  EXPECT_THAT(refused(path() / "nothing.map"), HasSubstr("nothing.map: No such file"));

  EXPECT_EQ(std::filesystem::last_write_time(map_), written);
  EXPECT_FALSE(std::filesystem::exists(map_.string() + ".old"));
  EXPECT_FALSE(std::filesystem::exists(map_.string() + ".new"));
  EXPECT_EQ(status(client)["pose"]["reset_counter"], resets);
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(kPatience), 0) << process.err();
}

TEST_F(GeoflowdMapTest, WithoutAFileOrASourceThereIsNothingToSave) {
  {
    Process process{daemon({}), path() / "log"};
    ControlClient client = connect();
    wait_for_mapping(client);
    EXPECT_THAT(ask(client, {{"cmd", "map"}, {"do", "save"}}).value("failed", ""),
                HasSubstr("map.file: no file is configured"));
    EXPECT_THAT(load(client, "/a.map").value("failed", ""),
                HasSubstr("map.file: no file is configured"));
  }
  std::filesystem::remove(control_);
  Process process{
      {GEOFLOWD_PROGRAM, "--pose-socket", pose_.string(), "--control-socket", control_.string(),
       "--set", "source.camera=d435i", "--set", "d435i.serial=\"000000000000\""},
      path() / "log"};
  ControlClient client = connect();
  EXPECT_THAT(ask(client, {{"cmd", "map"}, {"do", "save"}}).value("failed", ""),
              HasSubstr("the source is not open"));
}

TEST_F(GeoflowdMapTest, AReloadTakesWhatCanChangeAndAWrongFileChangesNothing) {
  const std::filesystem::path config = path() / "geoflow.toml";
  std::ofstream{config} << "[map]\nsave_interval_s = 50\n";
  Process process{daemon({"--config", config.string()}), path() / "log"};
  ControlClient client = connect();
  std::ofstream{config} << "[map]\nsave_interval_s = 7\nfile = \"x.map\"\n[socket]\nclients = 5\n";
  const json reply = ask(client, {{"cmd", "reload"}});
  EXPECT_THAT(reply.value("changed", json::array()), Contains("map.save_interval_s"));
  EXPECT_THAT(reply.value("changed", json::array()), Contains("socket.clients"));
  EXPECT_EQ(reply["restart"], json::array({"map.file"}));
  EXPECT_EQ(ask(client, {{"cmd", "config"}})["config"]["map.save_interval_s"], "7");
  EXPECT_EQ(ask(client, {{"cmd", "config"}})["config"]["map.file"], "''");

  std::ofstream{config} << "[map]\nsave_interval_s = 9\nsave_intervall_s = 9\n";
  EXPECT_THAT(ask(client, {{"cmd", "reload"}}).value("failed", ""),
              HasSubstr("geoflow.toml:3: map.save_intervall_s: unknown key"));
  EXPECT_EQ(ask(client, {{"cmd", "config"}})["config"]["map.save_interval_s"], "7");

  std::ofstream{config} << "[map]\nsave_interval_s = 11\n";
  process.send_signal(SIGHUP);
  wait_until(
      [&] { return ask(client, {{"cmd", "config"}})["config"]["map.save_interval_s"] == "11"; },
      "SIGHUP");
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(kPatience), 0) << process.err();
  EXPECT_THAT(process.err(), HasSubstr("at the next start only: map.file"));
}

}  // namespace
}  // namespace geoflow::daemon
