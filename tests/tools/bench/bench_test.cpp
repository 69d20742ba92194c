#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/replay_benchmark.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

BenchTable sample() {
  return {.benchmark = "sample",
          .columns = {"engine", "pairs", "total_ms"},
          .rows = {{std::string{"a, \"b\""}, std::int64_t{100}, 1.23456},
                   {std::string{"c"}, std::int64_t{7}, std::nan("")}}};
}

/// A program that acts as `geoflow replay RECORDING -o OUT`.
std::filesystem::path script(const std::filesystem::path& folder, const std::string& body) {
  const std::filesystem::path path = folder / "fake";
  std::ofstream{path} << "#!/bin/sh\n" << body << "\n";
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path;
}

TEST(BenchTable, IsPrintedAsMarkdown) {
  EXPECT_EQ(to_markdown(sample()),
            "| engine | pairs | total_ms |\n"
            "|-------:|------:|---------:|\n"
            "| a, \"b\" |   100 |    1.235 |\n"
            "|      c |     7 |        - |\n");
}

TEST(BenchTable, IsPrintedAsCsv) {
  EXPECT_EQ(to_csv(sample()), "engine,pairs,total_ms\n\"a, \"\"b\"\"\",100,1.23456\nc,7,\n");
}

TEST(BenchTable, IsPrintedAsJsonWithTheMachine) {
  const auto json = to_json(sample(), this_machine());
  EXPECT_EQ(json.at("benchmark"), "sample");
  EXPECT_EQ(json.at("rows").at(0).at("pairs"), 100);
  EXPECT_TRUE(json.at("rows").at(1).at("total_ms").is_null());
  EXPECT_GE(json.at("machine").at("cores").get<int>(), 1);
  EXPECT_FALSE(json.at("machine").at("cpu").get<std::string>().empty());
}

TEST(ReplayBenchmark, ReadsTheReportOfEachRun) {
  const tests::TemporaryDirectory folder;
  const auto program = script(folder.path(),
                              R"([ "$1 $2 $3 $5 $6" = "replay rec -o --calibration cal" ] || exit 9
echo '{"frames": 400, "tracked": 399, "peak_memory_mib": 123.5, "speed": {"frames_per_s": 80}, "times_ms": {"flow": {"mean": 1.5}}}' > "$4/report.json")");
  const auto table = run_replay_benchmark(
      {.program = program, .recording = "rec", .calibration = "cal", .runs = 2});
  ASSERT_TRUE(table) << table.error().message;
  const auto rows = to_json(*table, this_machine()).at("rows");
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[1].at("run"), 2);
  EXPECT_EQ(rows[1].at("frames"), 400);
  EXPECT_EQ(rows[1].at("tracked"), 399);
  EXPECT_EQ(rows[1].at("frames_per_s"), 80.0);
  EXPECT_EQ(rows[1].at("peak_memory_mib"), 123.5);
  EXPECT_EQ(rows[1].at("flow_ms"), 1.5);
  EXPECT_TRUE(rows[1].at("first_pose_s").is_null());
  EXPECT_GT(rows[1].at("wall_s").get<double>(), 0);
}

TEST(ReplayBenchmark, SaysWhatFailed) {
  const tests::TemporaryDirectory folder;
  const auto message = [&](const std::filesystem::path& program, int runs) {
    const auto table = run_replay_benchmark({.program = program, .recording = "rec", .runs = runs});
    return table ? std::string{"no error"} : table.error().message;
  };
  EXPECT_THAT(message(folder.path() / "none", 1), HasSubstr("none"));
  EXPECT_THAT(message(script(folder.path(), "exit 3"), 1), HasSubstr("exit code 3"));
  EXPECT_THAT(message(script(folder.path(), "kill -9 $$"), 1), HasSubstr("signal 9"));
  EXPECT_THAT(message(script(folder.path(), "true"), 1), HasSubstr("report.json"));
  EXPECT_THAT(message(script(folder.path(), "true"), 0), HasSubstr("0 runs"));
}

}  // namespace
}  // namespace geoflow::tools
