#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/data.hpp"

#include "process.hpp"

/// The estimator on a real recording with faults put on it: the pose stays on the trajectory, with
/// an error of at most twice the clean run's, and every fault is counted.
namespace geoflow::daemon {
namespace {

using tests::run_process;

nlohmann::json read_json(const std::filesystem::path& path) {
  std::ifstream file{path};
  return nlohmann::json::parse(file);
}

/// What came of one replay.
struct Outcome {
  double ate_m = 0;
  nlohmann::json report;
};

Outcome replay(const std::filesystem::path& kitchen, const std::string& script) {
  const tests::TemporaryDirectory directory;
  const auto out = directory.path() / "out";
  std::vector<std::string> command{GEOFLOW_PROGRAM, "replay", kitchen.string(), "-o", out.string()};
  if (!script.empty()) {
    std::ofstream{directory.path() / "faults.toml"} << script;
    command.insert(command.end(), {"--faults", (directory.path() / "faults.toml").string()});
  }
  const auto run = run_process(command, directory.path() / "replay");
  EXPECT_EQ(run.code, 0) << run.err;
  const auto evaluation =
      run_process({GEOFLOW_PROGRAM, "evaluate", (out / "final_camera.txt").string(),
                   (kitchen / "groundtruth.txt").string(), "--json"},
                  directory.path() / "evaluate");
  EXPECT_EQ(evaluation.code, 0) << evaluation.err;
  return {nlohmann::json::parse(evaluation.out)["ate"]["translation_m"]["rmse"],
          read_json(out / "report.json")};
}

struct Case {
  std::string name;
  std::string script;
  std::string counted;  ///< the kind that the report counts
};

std::string gap(double from_s) {
  return "[[fault]]\nkind = 'gap'\nstream = 'camera'\nfrom_s = " + std::to_string(from_s) +
         "\nuntil_s = " + std::to_string(from_s + 1) + "\n";
}

class KitchenFaults : public testing::TestWithParam<Case> {
 protected:
  static double clean_ate_m(const std::filesystem::path& kitchen) {
    static const double ate_m = replay(kitchen, "").ate_m;
    return ate_m;
  }
};

TEST_P(KitchenFaults, LeaveThePoseOnTheTrajectory) {
  GEOFLOW_DATA_OR_SKIP(kitchen, "kitchen-400");
  const Outcome outcome = replay(kitchen, GetParam().script);
  EXPECT_LE(outcome.ate_m, 2 * clean_ate_m(kitchen));
  const auto& counted = outcome.report["faults"][GetParam().counted];
  std::uint64_t count = 0;
  for (const auto& stream : counted) {
    count += stream.get<std::uint64_t>();
  }
  EXPECT_GT(count, 0U) << outcome.report["faults"];
  const auto clean_frames = 400U;
  EXPECT_LE(outcome.report["frames"].get<unsigned>(), clean_frames);
  RecordProperty("ate_m", std::to_string(outcome.ate_m));
}

// The camera turns by 20 degrees in the gaps at 2, 3, 6 and 7 s.
INSTANTIATE_TEST_SUITE_P(
    , KitchenFaults,
    testing::Values(
        Case{"Drop", "[[fault]]\nkind = 'drop'\nstream = 'color'\nprobability = 0.2\n", "drop"},
        Case{"Gap2", gap(2), "gap"}, Case{"Gap3", gap(3), "gap"}, Case{"Gap6", gap(6), "gap"},
        Case{"Gap7", gap(7), "gap"}, Case{"Gap9", gap(9), "gap"},
        Case{"Wrap", "[[fault]]\nkind = 'clock_wrap'\nstream = 'camera'\nfirst_wrap_s = 4\n",
             "clock_wrap"},
        Case{"DuplicateAndReorder",
             "[[fault]]\nkind = 'duplicate'\nstream = 'camera'\nprobability = 0.1\n"
             "[[fault]]\nkind = 'reorder'\nstream = 'camera'\nprobability = 0.1\n",
             "reorder"}),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace geoflow::daemon
