#include "geoflow/tools/verb.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/replay_benchmark.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/console.hpp"

#include "bench/gicp_benchmark.hpp"
#include "bench/gicp_table.hpp"

namespace geoflow::tools {
namespace {

constexpr int kMaxRuns = 1000;
constexpr int kMaxPairs = 100'000;

/// `geoflow bench BENCHMARK RECORDING`.
class BenchVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "bench"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Measure speed and memory on this machine, as a table";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow bench replay kitchen-400 --runs 5        frames a second, stage times and "
           "memory of five runs\n"
           "  geoflow bench replay kitchen-400 --csv           the same for a spreadsheet\n"
           "  geoflow bench gicp kitchen-400 --pairs 100       registration of depth frames beside "
           "PCL's, times and errors\n"
           "  geoflow bench replay kitchen-400 --json          the same for scripts, with the "
           "machine\n"
           "How to measure so that figures can be compared: docs/benchmarks.md.";
  }

  void declare(CLI::App& command) override {
    command
        .add_option("BENCHMARK", benchmark_,
                    "What to measure: replay, or gicp (frame-to-frame registration beside PCL's)")
        ->required()
        ->check(CLI::IsMember({"replay", "gicp"}).description(""));
    command.add_option("RECORDING", recording_, "Folder of the recording")->required();
    command.add_option("--runs", runs_, "replay: how many times")
        ->check(CLI::Range(1, kMaxRuns))
        ->capture_default_str();
    command.add_option("--calibration", calibration_,
                       "Folder with Kalibr files (default: the recording's)");
    command.add_option("--reference", reference_,
                       "gicp: TUM file of camera poses (default: groundtruth.txt in RECORDING)");
    command.add_option("--pairs", pairs_, "gicp: pairs of frames for each step")
        ->check(CLI::Range(1, kMaxPairs))
        ->capture_default_str();
    command.add_flag("--csv", csv_, "Print CSV instead of a Markdown table");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return measure().map([&](const BenchTable& table) {
      print(console, table);
      return ExitCode::kOk;
    });
  }

 private:
  [[nodiscard]] Result<BenchTable> measure() const {
    if (benchmark_ == "gicp") {
      GicpBenchmarkOptions options{.recording = recording_, .pairs = pairs_};
      if (!reference_.empty()) {
        options.reference = reference_;
      }
      return run_gicp_table(options);
    }
    std::error_code status;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", status);
    if (status) {
      return fail(ErrorCode::kSystem, "/proc/self/exe: {}", status.message());
    }
    return run_replay_benchmark(
        {.program = program, .recording = recording_, .calibration = calibration_, .runs = runs_});
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

  std::string benchmark_;
  std::string recording_;
  std::string calibration_;
  std::string reference_;
  int runs_ = 3;
  int pairs_ = 100;
  bool csv_ = false;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_bench_verb() {
  return std::make_unique<BenchVerb>();
}

}  // namespace geoflow::tools
