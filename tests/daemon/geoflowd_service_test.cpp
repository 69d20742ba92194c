#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "tests/support/data.hpp"

#include "notify_socket.hpp"
#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using tests::NotifySocket;
using tests::Process;
using tests::run_process;

using Words = std::vector<std::string>;

Words joined(Words first, const Words& second) {
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

TEST_F(GeoflowdService, IsReadyWhenItListensThenTellsItsStateAndThatItStops) {
  Process process{daemon({"WATCHDOG_USEC=1000000"}, replay()), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
  const auto client = PoseClient::connect(pose_, {.name = "test"});
  EXPECT_TRUE(client) << client.error().message;
  EXPECT_EQ(status().at("source").at("open"), true);
  EXPECT_TRUE(manager_.wait_for("STATUS=TRACKING "));
  EXPECT_THAT(manager_.messages().back(), HasSubstr("; camera ok"));
  EXPECT_TRUE(manager_.wait_for("WATCHDOG=1"));
  EXPECT_TRUE(manager_.wait_for("WATCHDOG=1"));
  process.send_signal(SIGTERM);
  EXPECT_TRUE(manager_.wait_for("STOPPING=1"));
  EXPECT_EQ(process.wait(seconds{60}), 0) << process.err();
}

TEST_F(GeoflowdService, TellsTheAgeOfASensorsNewestSampleAndThatItIsSilent) {
  const std::filesystem::path faults = path() / "faults.toml";
  std::ofstream{faults}
      << "[[fault]]\nkind = \"gap\"\nstream = \"camera\"\nfrom_s = 5.0\nuntil_s = 50.0\n";
  const Process process{daemon({}, joined(replay({.frames = 240, .rate_hz = 4, .shift_px = 1}),
                                          {"--faults", faults.string()})),
                        log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  const auto heard = status().at("health").at("camera");
  EXPECT_EQ(heard.at("state"), "streaming");
  EXPECT_LT(heard.at("last_sample_s").get<double>(), 1.5);
  ASSERT_TRUE(manager_.wait_for("camera silent")) << process.err();
  const auto silent = status().at("health").at("camera");
  EXPECT_EQ(silent.at("state"), "silent");
  EXPECT_GT(silent.at("last_sample_s").get<double>(), 1.5);
}

TEST_F(GeoflowdService, ARecordingThatIsNotThereIsAnErrorBeforeItIsReady) {
  const auto done = run_process(daemon({}, {"--replay", log("nothing").string()}), log("daemon"));
  EXPECT_EQ(done.code, 3);
  EXPECT_THAT(done.err, HasSubstr("nothing"));
  EXPECT_TRUE(manager_.is_silent_of("READY=1", std::chrono::milliseconds{1}));
}

TEST_F(GeoflowdService, WaitsForACameraThatIsNotThere) {
  Process process{daemon({"WATCHDOG_USEC=1000000"}, absent_camera()), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
  ASSERT_TRUE(manager_.wait_for("STATUS=STARTING; no D435i with the serial number 000000000000"))
      << process.err();
  const auto client = PoseClient::connect(pose_, {.name = "test"});
  EXPECT_TRUE(client) << client.error().message;
  for (int i = 0; i < 12; ++i) {  // three periods: waiting is not being stuck
    ASSERT_TRUE(manager_.wait_for("WATCHDOG=1")) << process.err();
  }
  const auto source = status().at("source");
  EXPECT_EQ(source.at("open"), false);
  EXPECT_THAT(source.at("trouble").get<std::string>(), HasSubstr("no D435i"));
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(seconds{60}), 0) << process.err();
  EXPECT_THAT(process.err(), HasSubstr("it is waited for"));
}

/// The kernel's numbers of the process's threads of that name. A thread's pools have its name as
/// well.
std::vector<pid_t> find_threads(pid_t process, const std::string& name) {
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

/// Stops the threads of that name, as a debugger does, and leaves the others. Those that it has
/// stopped; none, with errno, where that is not allowed.
std::vector<pid_t> stop_threads(pid_t process, const std::string& name) {
  std::vector<pid_t> stopped;
  errno = ESRCH;
  for (const pid_t thread : find_threads(process, name)) {
    int status = 0;
    if (::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) == 0 &&
        ::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) == 0 &&
        ::waitpid(thread, &status, __WALL) == thread && WIFSTOPPED(status)) {
      stopped.push_back(thread);
    }
  }
  return stopped;
}

class StuckThread : public GeoflowdService, public testing::WithParamInterface<const char*> {};

TEST_P(StuckThread, StarvesTheWatchdogUntilItMovesAgain) {
  // A minute, in which no thread ends and gives way to the next round's.
  const Process process{
      daemon({"WATCHDOG_USEC=1000000"}, replay({.frames = 240, .rate_hz = 4, .shift_px = 1})),
      log("daemon")};
  ASSERT_TRUE(manager_.wait_for("STATUS=TRACKING ")) << process.err();
  ASSERT_TRUE(manager_.wait_for("WATCHDOG=1"));
  const std::vector<pid_t> threads = stop_threads(process.pid(), GetParam());
  if (threads.empty() && errno == EPERM) {
    GTEST_SKIP() << "ptrace is not allowed here";
  }
  ASSERT_FALSE(threads.empty()) << std::generic_category().message(errno);
  bool starved = false;
  for (int i = 0; i < 100 && !starved; ++i) {
    starved = manager_.is_silent_of("WATCHDOG=1", seconds{3});
  }
  EXPECT_TRUE(starved) << process.err();
  for (const pid_t thread : threads) {
    ASSERT_EQ(::ptrace(PTRACE_DETACH, thread, nullptr, nullptr), 0);
  }
  EXPECT_TRUE(manager_.wait_for("WATCHDOG=1")) << process.err();
}

INSTANTIATE_TEST_SUITE_P(Threads, StuckThread, testing::Values("replay", "sync", "slam"));

TEST_F(GeoflowdService, UsesTheSocketsThatItIsGivenAndLeavesTheirFiles) {
  const UniqueFd pose = listening(path() / "given.pose", SOCK_SEQPACKET);
  const UniqueFd control = listening(path() / "given.ctl", SOCK_STREAM);
  // Connected before the daemon is there: it waits in the backlog.
  Process process{activated(control, pose, "control:pose", replay()), log("daemon")};
  const auto client = PoseClient::connect(path() / "given.pose", {.name = "early"});
  ASSERT_TRUE(client) << client.error().message;
  EXPECT_TRUE(manager_.wait_for("READY=1")) << process.err();
  EXPECT_FALSE(std::filesystem::exists(pose_));
  EXPECT_FALSE(std::filesystem::exists(control_));
  control_ = path() / "given.ctl";
  EXPECT_EQ(status().at("pose_socket").at("clients").size(), 1U);
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(seconds{60}), 0) << process.err();
  EXPECT_TRUE(std::filesystem::is_socket(path() / "given.pose"));
  EXPECT_TRUE(std::filesystem::is_socket(path() / "given.ctl"));
}

TEST_F(GeoflowdService, RefusesGivenSocketsThatItCannotUse) {
  const UniqueFd pose = listening(path() / "given.pose", SOCK_SEQPACKET);
  const UniqueFd control = listening(path() / "given.ctl", SOCK_STREAM);
  const auto refused = [&](const UniqueFd& first, const UniqueFd& second,
                           const std::string& names) {
    const auto done = run_process(activated(first, second, names, absent_camera()), log("refused"));
    EXPECT_EQ(done.code, 2) << names;
    return done.err;
  };
  EXPECT_THAT(refused(pose, control, "pose:geoflow.socket"),
              HasSubstr("'geoflow.socket' is none of geoflowd's sockets"));
  EXPECT_THAT(
      refused(control, pose, "pose:control"),
      HasSubstr("'pose' (descriptor 3) is not a listening Unix socket of type SOCK_SEQPACKET"));
  EXPECT_THAT(refused(pose, pose, "pose:pose"), HasSubstr("'pose' stands there twice"));
  EXPECT_THAT(refused(pose, control, "pose"), HasSubstr("$LISTEN_FDS=2"));
  const auto closed = run_process(
      joined({"/bin/bash", "-c", "export LISTEN_PID=$$ LISTEN_FDS=30; exec \"$@\"", "bash"},
             daemon({}, absent_camera())),
      log("closed"));
  EXPECT_EQ(closed.code, 2);
  EXPECT_THAT(closed.err, HasSubstr("$LISTEN_FDS=30"));
}

TEST_F(GeoflowdService, DoesNotTakeThePathOfASocketThatAnotherListensAt) {
  const UniqueFd another = listening(pose_, SOCK_SEQPACKET);
  const auto refused = run_process(daemon({}, absent_camera()), log("refused"));
  EXPECT_EQ(refused.code, 4);
  EXPECT_THAT(refused.err, HasSubstr("another process (" + std::to_string(::getpid()) + ")"));
  EXPECT_TRUE(std::filesystem::is_socket(pose_));
}

TEST_F(GeoflowdService, ComesUpAgainAfterItWasKilled) {
  for (int i = 0; i < 3; ++i) {
    Process process{daemon({}, absent_camera()), log("daemon")};
    ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
    EXPECT_TRUE(PoseClient::connect(pose_, {.name = "test"}));
    process.send_signal(SIGKILL);
    EXPECT_EQ(process.wait(seconds{60}), 128 + SIGKILL);
    EXPECT_TRUE(std::filesystem::is_socket(pose_));  // left behind
  }
}

TEST_F(GeoflowdService, LogsWithPrioritiesWhereStderrIsTheJournal) {
  const auto journal_of = [](const std::filesystem::path& file) {
    struct stat status{};
    EXPECT_EQ(::stat(file.c_str(), &status), 0);
    return "JOURNAL_STREAM=" + std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
  };
  const auto log_with = [&](const std::string& name, const std::string& journal) {
    Process process{daemon({journal}, absent_camera()), log(name)};
    EXPECT_TRUE(manager_.wait_for("READY=1")) << process.err();
    process.send_signal(SIGTERM);
    EXPECT_EQ(process.wait(seconds{60}), 0);
    return process.err();
  };
  std::ofstream{log("journal.err")} << "";
  const std::string in_journal = log_with("journal", journal_of(log("journal.err")));
  EXPECT_THAT(in_journal, StartsWith("<"));
  EXPECT_THAT(in_journal, HasSubstr("<6>daemon: stopping on signal 15"));
  const std::string elsewhere = log_with("elsewhere", journal_of(log("journal.err")));
  EXPECT_THAT(elsewhere, HasSubstr("info daemon: stopping on signal 15"));
  EXPECT_THAT(elsewhere, Not(HasSubstr("<6>")));
}

}  // namespace
}  // namespace geoflow::daemon
