#include "geoflow/tools/bench/replay_benchmark.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <sys/wait.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::literals::operator""_json_pointer;

constexpr int kMaxRuns = 1000;

/// A folder for one run's outputs, removed at the end of scope.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::error_code ignored;
    std::string pattern =
        (std::filesystem::temp_directory_path(ignored) / "geoflow-bench-XXXXXX").string();
    if (::mkdtemp(pattern.data()) != nullptr) {
      path_ = pattern;
    }
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  /// Empty where none could be made.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

/// Starts the command with standard output discarded and standard error kept, and waits for its
/// end.
Result<void> run_command(std::vector<std::string> arguments) {
  std::vector<char*> argv;
  for (std::string& argument : arguments) {
    argv.push_back(argument.data());
  }
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int status = ::posix_spawn(&child, argv.front(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (status != 0) {
    return fail(ErrorCode::kSystem, "{}: {}", arguments.front(),
                std::generic_category().message(status));
  }
  int ended = 0;
  while (::waitpid(child, &ended, 0) < 0) {
    if (errno != EINTR) {
      return fail_errno("waiting for the replay");
    }
  }
  if (!WIFEXITED(ended) || WEXITSTATUS(ended) != 0) {
    return fail(ErrorCode::kSystem, "the replay failed ({} {}); its message is above",
                WIFEXITED(ended) ? "exit code" : "signal",
                WIFEXITED(ended) ? WEXITSTATUS(ended) : WTERMSIG(ended));
  }
  return {};
}

Result<ReplayRun> run_once(const ReplayBenchmarkOptions& options) {
  const ScratchFolder scratch;
  if (scratch.path().empty()) {
    return fail_errno("a temporary folder for the replay's outputs");
  }
  std::vector<std::string> command{options.program.string(), "replay", options.recording.string(),
                                   "-o", scratch.path().string()};
  if (!options.calibration.empty()) {
    command.insert(command.end(), {"--calibration", options.calibration.string()});
  }
  const HostTime begin = HostClock::now();
  if (auto ran = run_command(std::move(command)); !ran) {
    return tl::unexpected{std::move(ran).error()};
  }
  ReplayRun run{.wall_s = to_seconds(HostClock::now() - begin), .report = {}};
  std::ifstream stream{scratch.path() / "report.json"};
  run.report = nlohmann::json::parse(stream, nullptr, false);
  if (!run.report.is_object()) {
    return fail(ErrorCode::kInvalidData, "the replay left no report.json that can be read");
  }
  return run;
}

/// The number at a JSON pointer; not a number where there is none.
double number(const nlohmann::json& report, const nlohmann::json::json_pointer& place) {
  return report.contains(place) && report.at(place).is_number()
             ? report.at(place).get<double>()
             : std::numeric_limits<double>::quiet_NaN();
}

/// A count as an integer cell where there is one.
BenchCell count(const nlohmann::json& report, const nlohmann::json::json_pointer& place) {
  const double value = number(report, place);
  return std::isfinite(value) ? BenchCell{static_cast<std::int64_t>(value)} : BenchCell{value};
}

}  // namespace

BenchTable replay_table(const std::vector<ReplayRun>& runs) {
  BenchTable table{
      .benchmark = "replay",
      .columns = {"run", "frames", "tracked", "frames_per_s", "frames_per_s_without_decoding",
                  "first_pose_s", "wall_s", "peak_memory_mib"},
      .rows = {}};
  std::set<std::string> stages;
  for (const ReplayRun& run : runs) {
    if (run.report.contains("times_ms") && run.report["times_ms"].is_object()) {
      for (const auto& [stage, times] : run.report["times_ms"].items()) {
        stages.insert(stage);
      }
    }
  }
  for (const std::string& stage : stages) {
    table.columns.push_back(stage + "_ms");
  }
  for (const ReplayRun& run : runs) {
    const auto index = static_cast<std::int64_t>(table.rows.size()) + 1;
    auto& row = table.rows.emplace_back(std::vector<BenchCell>{
        index, count(run.report, "/frames"_json_pointer),
        count(run.report, "/tracked"_json_pointer),
        number(run.report, "/speed/frames_per_s"_json_pointer),
        number(run.report, "/speed/frames_per_s_without_decoding"_json_pointer),
        number(run.report, "/speed/first_pose_s"_json_pointer), run.wall_s,
        number(run.report, "/peak_memory_mib"_json_pointer)});
    for (const std::string& stage : stages) {
      row.emplace_back(number(run.report, "/times_ms"_json_pointer / stage / "mean"));
    }
  }
  return table;
}

Result<BenchTable> run_replay_benchmark(const ReplayBenchmarkOptions& options) {
  if (options.runs < 1 || options.runs > kMaxRuns) {
    return fail(ErrorCode::kInvalidArgument, "{} runs: must be 1 to {}", options.runs, kMaxRuns);
  }
  std::vector<ReplayRun> runs;
  for (int i = 0; i < options.runs; ++i) {
    auto run = run_once(options);
    if (!run) {
      return tl::unexpected{std::move(run).error()};
    }
    runs.push_back(*std::move(run));
  }
  return replay_table(runs);
}

}  // namespace geoflow::tools
