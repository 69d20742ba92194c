#include "bench/table_command.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/processes.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "bench/suite/ablation.hpp"
#include "bench/suite/outcome.hpp"
#include "bench/suite/plan.hpp"
#include "bench/suite/sequences.hpp"
#include "bench/suite/simulated.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostJobs = 1024;

std::vector<std::string> configuration_keys() {
  std::vector<std::string> keys;
  for (const auto& value : daemon::list_keys(daemon::Config{})) {
    keys.push_back(value.key);
  }
  return keys;
}

bool done(const Run& run) {
  std::error_code error;
  return fs::exists(run.output / "report.json", error);
}

Result<void> write_text(const fs::path& file, const std::string& text) {
  std::ofstream stream{file, std::ios::binary | std::ios::trunc};
  stream << text;
  stream.close();
  return stream ? Result<void>{} : fail(ErrorCode::kSystem, "{}: cannot be written", file.string());
}

}  // namespace

/// All that one call is about.
struct TableCommand::Job {
  Suite suite = Suite::kTum;
  AblationRows rows;
  std::vector<Sequence> sequences;
  std::vector<Run> runs;
  fs::path output;
  fs::path program{};
  /// By the sequence's index: the command that makes its recording; empty where it is there.
  std::vector<std::vector<std::string>> make{};
};

std::string_view TableCommand::examples() {
  return "  geoflow bench table --suite tum --data ~/tum\n"
         "      every TUM RGB-D sequence below ~/tum in every row, on all cores\n"
         "  geoflow bench table --suite scannet --data ~/scannet --rows r+o,r+o+i+d --jobs 4\n"
         "      two rows of ScanNet's .sens files, four at a time\n"
         "  geoflow bench table --suite tum --data ~/tum --list | parallel\n"
         "      the same commands through GNU parallel, or line N in task N of a Slurm array\n"
         "  geoflow bench table --suite tum --data ~/tum --collect\n"
         "      the table of what they left\n"
         "  geoflow bench table --suite sim --data ~/sim --seeds 1-5 --scenes office,corridor\n"
         "      simulated places, made where they are missing\n"
         "What makes a sequence, and what the columns mean: docs/benchmarks.md.";
}

void TableCommand::declare(CLI::App& command) {
  command.add_option("--suite", suite_, "Data set: sim, tum, openloris, scannet or go2")
      ->required()
      ->check(CLI::IsMember({"sim", "tum", "openloris", "scannet", "go2"}).description(""));
  command.add_option("--data", data_, "Folder with its sequences, at any depth")->required();
  command.add_option("-o,--output", output_,
                     "Folder for results (default: out/table-SUITE); each run has SEQUENCE/ROW");
  command.add_option("--rows", rows_, "Only these rows, by commas: r, r+o, r+i, r+d, r+o+i+d")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      .add_option(
          "--set", settings_,
          "Overrides one key of the configuration in every run, section.key=value; repeatable")
      ->allow_extra_args(false);
  command.add_option("--seeds", seeds_,
                     "sim: these seeds of every scene, as 1-5,8; recordings that are missing are "
                     "made (default: what is there)");
  command.add_option("--scenes", scenes_, "sim: only these scenes, by commas (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("--duration", duration_s_, "sim: length of the recordings that are made [s]")
      ->check(CLI::PositiveNumber.description(""))
      ->capture_default_str();
  command.add_option("--jobs", jobs_, "Sequences at a time (default: the number of processors)")
      ->check(CLI::Range(std::size_t{1}, kMostJobs).description(""));
  command
      .add_option("--correct-within", correct_within_m_,
                  "Error up to which a pose counts for the correct rate [m]")
      ->check(CLI::PositiveNumber.description(""))
      ->capture_default_str();
  auto* list = command.add_flag("--list", list_, "Print the commands instead of running them");
  auto* collect = command.add_flag("--collect", collect_, "Only join the results that are there");
  command.add_flag("--resume", resume_, "Keep the results that are there, run the others")
      ->excludes(list)
      ->excludes(collect);
  list->excludes(collect);
}

Result<AblationRows> TableCommand::chosen_rows() const {
  AblationRows rows = ablation_rows(configuration_keys());
  if (rows_.empty()) {
    return rows;
  }
  AblationRows chosen;
  for (const std::string& name : rows_) {
    const auto found = std::ranges::find(rows.available, name, &AblationRow::name);
    if (found == rows.available.end()) {
      const auto why = std::ranges::find_if(rows.left_out, [&](const std::string& sentence) {
        return sentence.starts_with(name + ":");
      });
      return fail(ErrorCode::kInvalidArgument, "--rows: {}",
                  why != rows.left_out.end() ? *why : fmt::format("there is no row {}", name));
    }
    chosen.available.push_back(*found);
  }
  return chosen;
}

Result<TableCommand::Job> TableCommand::make_job() const {
  const std::optional<Suite> suite = suite_of(suite_);
  if (!suite) {
    return fail(ErrorCode::kInvalidArgument, "--suite: \"{}\" is none", suite_);
  }
  Job job{.suite = *suite, .rows = {}, .sequences = {}, .runs = {}, .output = output_};
  if (job.output.empty()) {
    job.output = fs::path{"out"} / ("table-" + suite_);
  }
  auto rows = chosen_rows();
  if (!rows) {
    return tl::unexpected{std::move(rows.error())};
  }
  job.rows = *std::move(rows);
  auto program = own_program();
  if (!program) {
    return tl::unexpected{std::move(program.error())};
  }
  job.program = *std::move(program);
  if (auto found = find(job); !found) {
    return tl::unexpected{std::move(found.error())};
  }
  job.runs = plan_runs(job.sequences, job.rows.available,
                       {.program = job.program, .output = job.output, .settings = settings_});
  return job;
}

Result<void> TableCommand::find(Job& job) const {
  const bool simulated = !seeds_.empty() || !scenes_.empty();
  if (simulated && job.suite != Suite::kSim) {
    return fail(ErrorCode::kInvalidArgument, "--seeds and --scenes are for the suite sim");
  }
  if (simulated) {
    return plan_simulated(job);
  }
  return find_sequences(job.suite, data_).map([&](std::vector<Sequence> sequences) {
    job.make.resize(sequences.size());
    job.sequences = std::move(sequences);
  });
}

Result<void> TableCommand::plan_simulated(Job& job) const {
  auto seeds = parse_seeds(seeds_.empty() ? "1" : seeds_);
  if (!seeds) {
    return tl::unexpected{std::move(seeds.error())};
  }
  std::vector<std::string> scenes = scenes_;
  if (scenes.empty()) {
    for (const simulator::SceneInfo& scene : simulator::scenes()) {
      scenes.emplace_back(scene.name);
    }
  }
  for (SimulatedSequence& one : plan_recordings({.program = job.program,
                                                 .data = data_,
                                                 .scenes = std::move(scenes),
                                                 .seeds = *std::move(seeds),
                                                 .duration_s = duration_s_})) {
    std::error_code error;
    const bool there = fs::exists(one.sequence.reference, error);
    job.sequences.push_back(std::move(one.sequence));
    job.make.push_back(there ? std::vector<std::string>{} : std::move(one.make));
  }
  return {};
}

std::size_t TableCommand::at_a_time() const {
  return jobs_ > 0 ? jobs_ : static_cast<std::size_t>(this_machine().cores);
}

/// Makes the recordings that are not there; false when interrupted.
Result<bool> TableCommand::record_missing(const Job& job, Console& console) const {
  std::vector<Command> commands;
  for (const auto& make : job.make) {
    if (!make.empty()) {
      commands.push_back({.arguments = make});
    }
  }
  const InterruptScope interrupt;
  const auto ended = run_processes(commands, at_a_time(), [&](std::size_t count) {
    console.progress(count, commands.size(), "recordings");
    return !InterruptScope::requested();
  });
  console.end_progress();
  if (!ended || InterruptScope::requested()) {
    return ended.map([](const auto& /*all*/) { return false; });
  }
  for (std::size_t i = 0; i < ended->size(); ++i) {
    if (!(*ended)[i].well()) {
      return fail(ErrorCode::kSystem, "{}: {}; its message is above",
                  shell_line(commands[i].arguments), (*ended)[i].how());
    }
  }
  return true;
}

/// One line for each task that needs no other: a run, or a recording and all its runs.
void TableCommand::list(const Job& job, Console& console) const {
  const std::size_t rows = job.rows.available.size();
  for (std::size_t i = 0; i < job.sequences.size(); ++i) {
    std::string line = job.make[i].empty() ? "" : shell_line(job.make[i]);
    for (std::size_t k = i * rows; k < (i + 1) * rows; ++k) {
      line += fmt::format("{}{}", line.empty() ? "" : " && ", shell_line(job.runs[k].arguments));
      if (job.make[i].empty()) {
        console.line("{}", line);
        console.object({{"sequence", job.sequences[i].name}, {"command", std::exchange(line, "")}});
      }
    }
    if (!line.empty()) {
      console.line("{}", line);
      console.object({{"sequence", job.sequences[i].name}, {"command", line}});
    }
  }
}

/// False when interrupted.
Result<bool> TableCommand::run_all(const Job& job, Console& console) const {
  std::vector<Command> commands;
  for (const Run& run : job.runs) {
    if (resume_ && done(run)) {
      continue;
    }
    auto command = prepare(run);
    if (!command) {
      return tl::unexpected{std::move(command.error())};
    }
    commands.push_back(*std::move(command));
  }
  const InterruptScope interrupt;
  const auto ended = run_processes(commands, at_a_time(), [&](std::size_t count) {
    console.progress(count, commands.size(), "runs");
    return !InterruptScope::requested();
  });
  console.end_progress();
  return ended.map([](const std::vector<Ended>& /*all*/) { return !InterruptScope::requested(); });
}

std::vector<Outcome> TableCommand::judge_all(const Job& job) const {
  std::vector<Outcome> outcomes;
  const Sequence* sequence = nullptr;
  Result<TrajectoryFile> truth;
  for (const Run& run : job.runs) {
    if (run.sequence != sequence) {
      sequence = run.sequence;
      truth = read_reference(*sequence);
    }
    outcomes.push_back(judge(*run.sequence, run.row->name, truth, run.output,
                             {.correct_within_m = correct_within_m_}));
  }
  return outcomes;
}

Result<void> TableCommand::publish(const Job& job, const std::vector<Outcome>& outcomes,
                                   Console& console) const {
  const BenchTable sequences = sequence_table(job.suite, outcomes);
  const BenchTable summary = summary_table(job.suite, outcomes);
  const Machine machine = this_machine();
  nlohmann::json object = to_json(sequences, machine);
  object["suite"] = suite_;
  object["summary"] = to_json(summary, machine).at("rows");
  object["left_out"] = job.rows.left_out;
  console.object(object);
  std::string text =
      fmt::format("{}: {} cores, {}, {}\n\n{}\n{}", machine.cpu, machine.cores, machine.kernel,
                  machine.compiler, to_markdown(sequences), to_markdown(summary));
  for (const std::string& sentence : job.rows.left_out) {
    text += fmt::format("\nLeft out: {}.\n", sentence);
  }
  console.line("{}", text);
  constexpr int kIndent = 2;
  // NOLINTNEXTLINE(modernize-avoid-c-arrays): a list of two columns
  const std::pair<const char*, std::string> files[] = {{"table.md", text},
                                                       {"sequences.csv", to_csv(sequences)},
                                                       {"summary.csv", to_csv(summary)},
                                                       {"table.json", object.dump(kIndent) + "\n"}};
  for (const auto& [name, content] : files) {
    if (auto written = write_text(job.output / name, content); !written) {
      return written;
    }
  }
  console.line("written to {}: table.md sequences.csv summary.csv table.json", job.output.string());
  return {};
}

Result<ExitCode> TableCommand::run(Console& console) const {
  const auto job = make_job();
  if (!job) {
    return tl::unexpected{job.error()};
  }
  if (list_) {
    list(*job, console);
    return ExitCode::kOk;
  }
  if (!collect_) {
    const auto finished = record_missing(*job, console).and_then([&](bool recorded) {
      return recorded ? run_all(*job, console) : Result<bool>{false};
    });
    if (!finished) {
      return tl::unexpected{finished.error()};
    }
    if (!*finished) {
      return ExitCode::kInterrupted;
    }
  }
  return publish(*job, judge_all(*job), console).map([] { return ExitCode::kOk; });
}

}  // namespace geoflow::tools
