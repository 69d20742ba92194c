#include "geoflow/tools/verb.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/processes.hpp"
#include "geoflow/tools/bench/replay_benchmark.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"

#include "bench/clients_benchmark.hpp"
#include "bench/gicp_benchmark.hpp"
#include "bench/gicp_table.hpp"
#include "bench/simulate_benchmark.hpp"
#include "bench/table_command.hpp"

namespace geoflow::tools {
namespace {

constexpr int kMaxRuns = 1000;
constexpr int kMaxPairs = 100'000;
constexpr int kMaxFrames = 100'000;

constexpr std::string_view kExamples =
    "  geoflow bench replay kitchen-400 --runs 5        frames a second, stage times and "
    "memory of five runs\n"
    "  geoflow bench replay kitchen-400 --csv           the same for a spreadsheet\n"
    "  geoflow bench gicp kitchen-400 --pairs 100       registration of depth frames beside "
    "PCL's, times and errors\n"
    "  geoflow bench clients kitchen-400                the daemon alone and among 64 clients\n"
    "  geoflow bench simulate                           how fast simulated places are made\n"
    "  geoflow bench table --suite tum --data ~/tum     accuracy on a data set, row by row\n"
    "  geoflow bench replay kitchen-400 --json          the same for scripts, with the "
    "machine\n"
    "How to measure so that figures can be compared: docs/benchmarks.md.";

/// `geoflow bench BENCHMARK …`.
class BenchVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "bench"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Measure speed, memory and accuracy on this machine, as a table";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }

  void declare(CLI::App& command) override {
    command.require_subcommand(1);
    replay_ = add(command, "replay", "Replay a recording: speed, memory, stage times");
    add_recording(*replay_);
    add_runs(*replay_);
    gicp_ = add(command, "gicp", "Register depth frame to frame, beside PCL");
    add_recording(*gicp_);
    gicp_->add_option("--reference", reference_,
                      "TUM file of camera poses (default: groundtruth.txt in RECORDING)");
    gicp_->add_option("--pairs", pairs_, "Pairs of frames for each step")
        ->check(CLI::Range(1, kMaxPairs))
        ->capture_default_str();
    clients_ = add(command, "clients", "Run the daemon alone and with 64 clients, some hostile");
    add_recording(*clients_);
    add_runs(*clients_);
    simulate_ = add(command, "simulate", "Simulate places: frames a second, and what takes it");
    simulate_
        ->add_option("--scenes", simulated_.scenes,
                     "Only these scenes, by commas (default: seven that differ)")
        ->delimiter(',')
        ->allow_extra_args(false);
    simulate_->add_option("--frames", simulated_.frames, "Frames of each scene")
        ->check(CLI::Range(kFewestBenchmarkFrames, kMaxFrames))
        ->capture_default_str();
    simulate_->add_flag("--csv", csv_, "Print CSV instead of a Markdown table");
    CLI::App* table = add(command, "table", "Run a whole data set in the paper's ablation rows");
    table->footer("Examples:\n" + std::string{TableCommand::examples()});
    table_.declare(*table);
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    if (!replay_->parsed() && !gicp_->parsed() && !clients_->parsed() && !simulate_->parsed()) {
      return table_.run(console);
    }
    return measure(console).map([&](const BenchTable& table) {
      print(console, table);
      return ExitCode::kOk;
    });
  }

 private:
  /// A benchmark; what is none of its options is the verb's (`--json`).
  static CLI::App* add(CLI::App& command, const std::string& name, const std::string& summary) {
    CLI::App* benchmark = command.add_subcommand(name, summary);
    benchmark->fallthrough();
    return benchmark;
  }

  void add_recording(CLI::App& benchmark) {
    benchmark.add_option("RECORDING", recording_, "Folder of the recording")->required();
    benchmark.add_flag("--csv", csv_, "Print CSV instead of a Markdown table");
  }

  void add_runs(CLI::App& benchmark) {
    benchmark.add_option("--runs", runs_, "How many times")
        ->check(CLI::Range(1, kMaxRuns))
        ->capture_default_str();
    benchmark.add_option("--calibration", calibration_,
                         "Folder with Kalibr files (default: the recording's)");
  }

  [[nodiscard]] Result<BenchTable> measure(Console& console) const {
    if (simulate_->parsed()) {
      const InterruptScope interrupt;
      auto table = run_simulate_benchmark(simulated_, [&](std::size_t done, std::size_t total) {
        console.progress(done, total, "scenes");
        return !InterruptScope::requested();
      });
      console.end_progress();
      return table;
    }
    if (gicp_->parsed()) {
      GicpBenchmarkOptions options{.recording = recording_, .pairs = pairs_};
      if (!reference_.empty()) {
        options.reference = reference_;
      }
      return run_gicp_table(options);
    }
    return own_program().and_then([&](const auto& program) {
      if (clients_->parsed()) {
        return run_clients_benchmark({.program = program.parent_path() / "geoflowd",
                                      .recording = recording_,
                                      .calibration = calibration_,
                                      .runs = runs_});
      }
      return run_replay_benchmark({.program = program,
                                   .recording = recording_,
                                   .calibration = calibration_,
                                   .runs = runs_});
    });
  }

  void print(Console& console, const BenchTable& table) const {
    const Machine machine = this_machine();
    console.object(to_json(table, machine));
    std::string text = csv_ ? to_csv(table) : to_markdown(table);
    text.pop_back();  // line() ends the last line
    if (!csv_) {
      console.line("{}, {} cores, {}, {}\n", machine.cpu, machine.cores, machine.kernel,
                   machine.compiler);
    }
    console.line("{}", text);
  }

  CLI::App* replay_ = nullptr;
  CLI::App* gicp_ = nullptr;
  CLI::App* clients_ = nullptr;
  CLI::App* simulate_ = nullptr;
  SimulateBenchmarkOptions simulated_;
  TableCommand table_;
  std::string recording_;
  std::string calibration_;
  std::string reference_;
  int runs_ = 3;
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  int pairs_ = 100;
  bool csv_ = false;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_bench_verb() {
  return std::make_unique<BenchVerb>();
}

}  // namespace geoflow::tools
