#include "bench/suite/plan.hpp"

#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/processes.hpp"

#include "bench/suite/ablation.hpp"
#include "bench/suite/sequences.hpp"

namespace geoflow::tools {
namespace {

void append_settings(const std::vector<std::string>& settings,
                     std::vector<std::string>& arguments) {
  for (const std::string& setting : settings) {
    arguments.insert(arguments.end(), {"--set", setting});
  }
}

}  // namespace

std::vector<Run> plan_runs(const std::vector<Sequence>& sequences,
                           const std::vector<AblationRow>& rows, const PlanOptions& options) {
  std::vector<Run> runs;
  for (const Sequence& sequence : sequences) {
    for (const AblationRow& row : rows) {
      Run& run = runs.emplace_back(Run{.sequence = &sequence,
                                       .row = &row,
                                       .output = options.output / sequence.name / row.name,
                                       .arguments = {}});
      run.arguments = {options.program.string(), "replay", sequence.recording.string(), "-o",
                       run.output.string()};
      append_settings(options.settings, run.arguments);
      append_settings(row.settings, run.arguments);
    }
  }
  return runs;
}

Result<Command> prepare(const Run& run) {
  std::error_code error;
  std::filesystem::create_directories(run.output, error);
  for (const char* const file :
       {"report.json", "live_base.txt", "live_camera.txt", "final_base.txt", "final_camera.txt"}) {
    if (!error) {
      std::filesystem::remove(run.output / file, error);
    }
  }
  if (error) {
    return fail(ErrorCode::kSystem, "{}: {}", run.output.string(), error.message());
  }
  return Command{.arguments = run.arguments, .log = run.output / "log.txt"};
}

}  // namespace geoflow::tools
