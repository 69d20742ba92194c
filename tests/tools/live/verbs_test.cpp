#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::tools {
namespace {

using geoflow::tests::Finished;
using geoflow::tests::Process;
using geoflow::tests::run_process;
using geoflow::tests::TemporaryDirectory;
using nlohmann::json;
using std::chrono::seconds;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream{text};
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
  }
  return lines;
}

/// The verbs that speak with a running daemon, as programs.
class LiveVerbs : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryDirectory>();
    geoflow::tests::write_synthetic_recording(shared_->path() / "recording", {.frames = 300});
  }
  static void TearDownTestSuite() { shared_.reset(); }

  [[nodiscard]] const std::filesystem::path& path() const { return directory_.path(); }

  /// Starts the daemon, and waits until it has made a map.
  void start_daemon() {
    daemon_ = std::make_unique<Process>(
        std::vector<std::string>{
            GEOFLOWD_PROGRAM, "--replay", (shared_->path() / "recording").string(), "--loop",
            "--pose-socket", pose_.string(), "--control-socket", control_.string(), "--set",
            "map.save_interval_s=0", "--set", "map.file=\"" + map_.string() + "\""},
        path() / "daemon");
    const HostTime deadline = HostClock::now() + seconds{60};
    while (!has_map()) {
      if (HostClock::now() > deadline) {
        throw std::runtime_error{"no map in a minute: " + daemon_->err()};
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    }
  }
  [[nodiscard]] bool has_map() const {
    auto client = daemon::ControlClient::connect(control_);
    const auto reply =
        client ? client->request({{"cmd", "status"}}, seconds{10}) : Result<json>{json::object()};
    return reply && reply->value("/status/mapping_runs"_json_pointer, 0) > 2;
  }

  /// `geoflow words… --socket SOCKET`.
  [[nodiscard]] Finished geoflow(std::vector<std::string> words) const {
    words.insert(words.begin(), GEOFLOW_PROGRAM);
    words.insert(words.end(), {"--socket", control_.string()});
    return run_process(words, path() / "verb");
  }
  [[nodiscard]] json object(const std::vector<std::string>& words) const {
    const Finished finished = geoflow(words);
    EXPECT_EQ(finished.code, 0) << finished.err;
    return json::parse(finished.out, nullptr, false);
  }

  static inline std::unique_ptr<TemporaryDirectory> shared_;
  TemporaryDirectory directory_;
  std::filesystem::path pose_ = path() / "pose.sock";
  std::filesystem::path control_ = path() / "ctl.sock";
  std::filesystem::path map_ = path() / "maps" / "test.map";
  std::unique_ptr<Process> daemon_;
};

TEST_F(LiveVerbs, WithoutADaemonTheCodeIsFour) {
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"status"},
                                             {"top"},
                                             {"watch"},
                                             {"reset"},
                                             {"map", "save"},
                                             {"map", "load", "x"},
                                             {"map", "reset"}}) {
    const Finished finished = geoflow(words);
    EXPECT_EQ(finished.code, 4) << words.front();
    EXPECT_THAT(finished.err, HasSubstr("ctl.sock: no such socket; is geoflowd running?"));
  }
}

TEST_F(LiveVerbs, TellHowTheDaemonIs) {
  std::filesystem::create_directory(map_.parent_path());
  start_daemon();
  const Finished words = geoflow({"status"});
  EXPECT_EQ(words.code, 0) << words.err;
  EXPECT_THAT(words.out, HasSubstr("process " + std::to_string(daemon_->pid())));
  EXPECT_THAT(words.out, HasSubstr("map      " + map_.string() + ", not saved yet"));
  const json status = object({"status", "--json"});
  EXPECT_EQ(status["pid"], daemon_->pid());
  EXPECT_GT(status["frames"], 0);
  EXPECT_TRUE(status["health"].contains("camera"));
  EXPECT_TRUE(status["pose"].contains("p_odom_base"));

  const Finished watched =
      geoflow({"watch", "--json", "--rate", "0", "--count", "5", "--pose-socket", pose_.string()});
  EXPECT_EQ(watched.code, 0) << watched.err;
  int poses = 0;
  int states = 0;
  for (const std::string& line : lines_of(watched.out)) {
    const json value = json::parse(line);
    poses += value["stream"] == "pose" ? 1 : 0;
    states += value["stream"] == "status" ? 1 : 0;
  }
  EXPECT_EQ(poses, 5);
  EXPECT_GE(states, 1);

  const Finished top = geoflow({"top", "--interval", "0.5", "--count", "2"});
  EXPECT_EQ(top.code, 0) << top.err;
  EXPECT_THAT(top.out, HasSubstr("SENSOR"));
  EXPECT_THAT(top.out, HasSubstr("process"));
  EXPECT_THAT(top.out, Not(HasSubstr("\x1b"))) << "what is no terminal gets no escapes";
  const json rates = object({"top", "--json", "--interval", "1", "--count", "1"});
  EXPECT_GT(rates["rates"]["sources"]["camera"], 0.0);
}

TEST_F(LiveVerbs, SaveListResetAndLoadTheMap) {
  std::filesystem::create_directory(map_.parent_path());
  start_daemon();
  const json saved = object({"map", "save", "--json"});
  EXPECT_EQ(saved["saved"], map_.string());
  EXPECT_GT(saved["keyframes"], 0);
  std::ofstream{map_.parent_path() / "notes.txt"} << "no map";
  std::ofstream{map_.parent_path() / "damaged.map"} << "GFLOWMAP and no more";
  const Finished listed = run_process(
      {GEOFLOW_PROGRAM, "map", "ls", map_.parent_path().string(), "--json"}, path() / "verb");
  EXPECT_EQ(listed.code, 0) << listed.err;
  const std::vector<std::string> lines = lines_of(listed.out);
  ASSERT_EQ(lines.size(), 2U) << listed.out;
  EXPECT_TRUE(json::parse(lines[0]).contains("damaged")) << lines[0];
  EXPECT_EQ(json::parse(lines[1])["keyframes"], saved["keyframes"]);

  EXPECT_GT(object({"reset", "--json"})["keyframes"], 0);
  EXPECT_THAT(geoflow({"map", "reset"}).out, HasSubstr(map_.string() + ".old"));
  EXPECT_TRUE(std::filesystem::exists(map_.string() + ".old"));

  const json loaded =
      object({"map", "load", "--json", std::filesystem::relative(map_.string() + ".old").string()});
  EXPECT_THAT(loaded["loaded"].get<std::string>(), EndsWith("test.map.old"));
  EXPECT_GE(loaded["keyframes"], saved["keyframes"]);
  EXPECT_THAT(geoflow({"map", "load", (map_.parent_path() / "damaged.map").string()}).err,
              HasSubstr("damaged.map"));
}

TEST_F(LiveVerbs, MapLsOfNoFolderIsAnError) {
  const Finished listed =
      run_process({GEOFLOW_PROGRAM, "map", "ls", (path() / "none").string()}, path() / "verb");
  EXPECT_EQ(listed.code, 3);
  EXPECT_THAT(listed.err, HasSubstr("none: No such file"));
}

TEST_F(LiveVerbs, ABugReportHoldsWhatItSaysAndNoImages) {
  std::filesystem::create_directory(map_.parent_path());
  start_daemon();
  const std::filesystem::path config = path() / "geoflow.toml";
  std::ofstream{config} << "# as it was\n";
  const std::filesystem::path archive = path() / "report.tar.gz";
  const json written =
      object({"bugreport", "--json", "-o", archive.string(), "--config", config.string()});
  EXPECT_EQ(written["written"], archive.string());
  EXPECT_EQ(written["daemon"], true);
  EXPECT_FALSE(std::filesystem::exists(archive.string() + ".tmp"));

  const std::filesystem::path unpacked = path() / "unpacked";
  std::filesystem::create_directory(unpacked);
  ASSERT_EQ(
      run_process({"/bin/tar", "-C", unpacked.string(), "-xzf", archive.string()}, path() / "tar")
          .code,
      0);
  std::vector<std::string> names;
  std::filesystem::path folder;
  for (const auto& entry : std::filesystem::recursive_directory_iterator{unpacked}) {
    if (entry.is_regular_file()) {
      names.push_back(entry.path().filename());
      folder = entry.path().parent_path();
    }
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre("versions.txt", "status.json",
                                                   "configuration.json", "geoflow.toml",
                                                   "machine.txt", "devices.txt", "log.txt"));
  const auto text = [&](const char* name) {
    std::ifstream stream{folder / name};
    return std::string{std::istreambuf_iterator<char>{stream}, {}};
  };
  EXPECT_EQ(json::parse(text("status.json"))["pid"], daemon_->pid());
  EXPECT_EQ(json::parse(text("configuration.json"))["map.save_interval_s"], "0");
  EXPECT_THAT(text("geoflow.toml"), HasSubstr("# as it was"));
  EXPECT_THAT(text("versions.txt"), HasSubstr("geoflowd"));
  EXPECT_THAT(text("machine.txt"), HasSubstr("kernel Linux"));
  EXPECT_EQ(text("log.txt"), daemon_->err());
}

TEST_F(LiveVerbs, ABugReportNeedsNoDaemonAndTakesAttachments) {
  std::ofstream{path() / "note.txt"} << "it fell";
  const std::filesystem::path archive = path() / "report.tar.gz";
  const json written = object(
      {"bugreport", "--json", "-o", archive.string(), "--attach", (path() / "note.txt").string()});
  EXPECT_EQ(written["daemon"], false);
  const Finished listed = run_process({"/bin/tar", "-tzf", archive.string()}, path() / "tar");
  EXPECT_THAT(listed.out, HasSubstr("attached/note.txt"));
  const Finished missing =
      geoflow({"bugreport", "-o", archive.string(), "--attach", (path() / "none").string()});
  EXPECT_EQ(missing.code, 3);
  EXPECT_THAT(missing.err, HasSubstr("none: no such file or folder"));
}

}  // namespace
}  // namespace geoflow::tools
