#include "geoflow/tools/bench/replay_benchmark.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/bench/processes.hpp"
#include "geoflow/tools/bench/scratch_folder.hpp"
#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::literals::operator""_json_pointer;

constexpr int kMaxRuns = 1000;

/// Runs the command alone and waits for its end.
Result<void> run_command(std::vector<std::string> arguments) {
  const Command command{.arguments = std::move(arguments)};
  const auto ended = run_processes({&command, 1}, 1, [](std::size_t /*done*/) { return true; });
  if (!ended) {
    return tl::unexpected{ended.error()};
  }
  if (!ended->front().well()) {
    return fail(ErrorCode::kSystem, "the replay failed ({}); its message is above",
                ended->front().how());
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
