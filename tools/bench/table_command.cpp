#include "bench/table_command.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/tools/bench/processes.hpp"
#include "geoflow/tools/interrupt.hpp"

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
};

std::string_view TableCommand::examples() {
  return "  geoflow bench table --suite tum --data ~/tum\n"
         "      every TUM RGB-D sequence below ~/tum in every row, on all cores\n"
         "  geoflow bench table --suite scannet --data ~/scannet --rows r+o,r+o+i --jobs 4\n"
         "      two rows of ScanNet's .sens files, four at a time\n"
         "  geoflow bench table --suite tum --data ~/tum --list | parallel\n"
         "      the same commands through GNU parallel, or line N in task N of a Slurm array\n"
         "  geoflow bench table --suite tum --data ~/tum --collect\n"
         "      the table of what they left\n"
         "What makes a sequence, and what the columns mean: docs/benchmarks.md.";
}

void TableCommand::declare(CLI::App& command) {
  command.add_option("--suite", suite_, "Data set: sim, tum, openloris, scannet or go2")
      ->required()
      ->check(CLI::IsMember({"sim", "tum", "openloris", "scannet", "go2"}).description(""));
  command.add_option("--data", data_, "Folder with its sequences, at any depth")->required();
  command.add_option("-o,--output", output_,
                     "Folder for results (default: out/table-SUITE); each run has SEQUENCE/ROW");
  command
      .add_option("--rows", rows_, "Only these rows, by commas: r, r+o, r+i, r+d, r+o+i, r+o+i+d")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      .add_option(
          "--set", settings_,
          "Overrides one key of the configuration in every run, section.key=value; repeatable")
      ->allow_extra_args(false);
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
  Job job{.suite = *suite_of(suite_), .rows = {}, .sequences = {}, .runs = {}, .output = output_};
  if (job.output.empty()) {
    job.output = fs::path{"out"} / ("table-" + suite_);
  }
  auto rows = chosen_rows();
  if (!rows) {
    return tl::unexpected{std::move(rows.error())};
  }
  job.rows = *std::move(rows);
  auto sequences = find_sequences(job.suite, data_);
  if (!sequences) {
    return tl::unexpected{std::move(sequences.error())};
  }
  job.sequences = *std::move(sequences);
  auto program = own_program();
  if (!program) {
    return tl::unexpected{std::move(program.error())};
  }
  job.runs = plan_runs(job.sequences, job.rows.available,
                       {.program = *program, .output = job.output, .settings = settings_});
  return job;
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
  const std::size_t at_a_time = jobs_ > 0 ? jobs_ : static_cast<std::size_t>(this_machine().cores);
  const auto ended = run_processes(commands, at_a_time, [&](std::size_t count) {
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
  const std::pair<const char*, std::string> files[] = {
      // NOLINT(modernize-avoid-c-arrays): a list of two columns
      {"table.md", text},
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
    for (const Run& run : job->runs) {
      console.line("{}", shell_line(run.arguments));
      console.object(
          {{"sequence", run.sequence->name}, {"row", run.row->name}, {"command", run.arguments}});
    }
    return ExitCode::kOk;
  }
  if (!collect_) {
    const auto finished = run_all(*job, console);
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
