#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

#include "bench/suite/ablation.hpp"
#include "bench/suite/outcome.hpp"
#include "bench/suite/plan.hpp"
#include "bench/suite/published.hpp"
#include "bench/suite/sequences.hpp"
#include "bench/suite/simulated.hpp"

namespace geoflow::tools {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

namespace fs = std::filesystem;

const std::string flow_key = "slam.switches.optical_flow";
const std::string gicp_key = "slam.switches.gicp";
const std::string map_key = "slam.switches.depth_to_map";

std::vector<std::string> names(const AblationRows& rows) {
  std::vector<std::string> all;
  all.reserve(rows.available.size());
  for (const AblationRow& row : rows.available) {
    all.push_back(row.name);
  }
  return all;
}

TEST(Ablation, RowsFollowTheSwitchesThatThereAre) {
  const std::vector<std::string> keys = {"slam.pose.iterations", flow_key, gicp_key};
  const AblationRows rows = ablation_rows(keys);
  EXPECT_THAT(names(rows), ElementsAre("r", "r+o", "r+i"));
  EXPECT_THAT(rows.available[1].settings, ElementsAre(flow_key + "=true", gicp_key + "=false"));
  EXPECT_THAT(rows.left_out, ElementsAre("r+d: this estimator has no switch " + map_key,
                                         "r+o+i+d: this estimator has no switch " + map_key));
}

TEST(Ablation, AllRowsWhereAllSwitchesAre) {
  const std::vector<std::string> keys = {flow_key, gicp_key, map_key};
  const AblationRows rows = ablation_rows(keys);
  EXPECT_THAT(names(rows), ElementsAre("r", "r+o", "r+i", "r+d", "r+o+i+d"));
  EXPECT_THAT(rows.left_out, IsEmpty());
  EXPECT_THAT(rows.available[0].settings,
              ElementsAre(flow_key + "=false", gicp_key + "=false", map_key + "=false"));
  EXPECT_THAT(rows.available[4].settings,
              ElementsAre(flow_key + "=true", gicp_key + "=true", map_key + "=true"));
}

TEST(Published, SequencesAreFoundByTheirDataSetsNames) {
  ASSERT_NE(find_published("tum", "tum/rgbd_dataset_freiburg1_desk"), nullptr);
  EXPECT_EQ(find_published("tum", "rgbd_dataset_freiburg1_desk")->ate_m, 0.0162);
  EXPECT_EQ(find_published("tum", "rgbd_dataset_freiburg1_desk2"), nullptr);
  EXPECT_EQ(find_published("openloris", "rgbd_dataset_freiburg1_desk"), nullptr);
  EXPECT_TRUE(find_published("scannet", "scene0616_00")->in_table_iii);
  EXPECT_EQ(table_iii_size("tum"), 7U);
  EXPECT_EQ(table_iii_size("scannet"), 9U);
  EXPECT_EQ(find_published_mean("tum", "r+o+i+d")->rte_m, 0.0086);
  EXPECT_EQ(find_published_mean("tum", "r"), nullptr);
}

void touch(const fs::path& file) {
  fs::create_directories(file.parent_path());
  std::ofstream{file} << "\n";
}

TEST(Sequences, AreFoundAtAnyDepthInOrderOfName) {
  const tests::TemporaryDirectory data;
  for (const char* const folder : {"b/seq2", "a/seq1", "a/incomplete"}) {
    touch(data.path() / folder / "rgb.txt");
    touch(data.path() / folder / "depth.txt");
  }
  touch(data.path() / "a/seq1/groundtruth.txt");
  touch(data.path() / "b/seq2/groundtruth.txt");
  const auto found = find_sequences(Suite::kTum, data.path());
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->size(), 2U);
  EXPECT_EQ((*found)[0].name, "a/seq1");
  EXPECT_EQ((*found)[1].reference, data.path() / "b/seq2/groundtruth.txt");
  EXPECT_EQ((*found)[0].frame, ReferenceFrame::kCamera);
  const auto one = find_sequences(Suite::kTum, data.path() / "a" / "seq1");
  ASSERT_TRUE(one);
  EXPECT_EQ(one->front().name, "seq1");
}

TEST(Sequences, EachSuiteHasItsMarks) {
  const tests::TemporaryDirectory data;
  touch(data.path() / "scene0050_00/scene0050_00.sens");
  touch(data.path() / "flat.sens");
  touch(data.path() / "office1-1/color.txt");
  touch(data.path() / "office1-1/aligned_depth.txt");
  touch(data.path() / "office1-1/groundtruth.txt");
  touch(data.path() / "Seq1/bag.db3");
  touch(data.path() / "Seq1/groundtruth_base.txt");
  touch(data.path() / "bag_without_truth/metadata.yaml");
  const auto scans = find_sequences(Suite::kScannet, data.path());
  ASSERT_TRUE(scans);
  ASSERT_EQ(scans->size(), 2U);
  EXPECT_EQ((*scans)[0].name, "flat");
  EXPECT_EQ((*scans)[1].name, "scene0050_00");
  EXPECT_TRUE((*scans)[1].reference.empty());
  const auto loris = find_sequences(Suite::kOpenloris, data.path());
  ASSERT_TRUE(loris);
  EXPECT_EQ(loris->at(0).frame, ReferenceFrame::kBase);
  const auto go2 = find_sequences(Suite::kGo2, data.path());
  ASSERT_TRUE(go2);
  ASSERT_EQ(go2->size(), 1U);
  EXPECT_EQ(go2->at(0).frame, ReferenceFrame::kBase);
}

TEST(Sequences, AnEmptyFolderSaysWhatWasLookedFor) {
  const tests::TemporaryDirectory data;
  const auto none = find_sequences(Suite::kScannet, data.path());
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(none.error().message, HasSubstr(".sens files"));
  EXPECT_FALSE(find_sequences(Suite::kTum, data.path() / "nowhere"));
}

TEST(Simulated, SeedsAreNumbersAndRanges) {
  EXPECT_THAT(parse_seeds("1-3,8").value(), ElementsAre(1U, 2U, 3U, 8U));
  for (const char* const wrong : {"x", "1-", "3-1", "1,,2", "-1", "0-99999999", "1 "}) {
    const auto seeds = parse_seeds(wrong);
    ASSERT_FALSE(seeds) << wrong;
    EXPECT_THAT(seeds.error().message, HasSubstr("--seeds"));
  }
}

TEST(Simulated, EverySceneWithEverySeed) {
  const auto planned = plan_recordings({.program = "/bin/geoflow",
                                        .data = "/data",
                                        .scenes = {"office", "plaza"},
                                        .seeds = {1, 7},
                                        .duration_s = 12.5});
  ASSERT_EQ(planned.size(), 4U);
  EXPECT_EQ(planned[3].sequence.name, "plaza-7");
  EXPECT_EQ(planned[3].sequence.reference, "/data/plaza-7/groundtruth.txt");
  EXPECT_THAT(planned[3].make,
              ElementsAre("/bin/geoflow", "simulate", "plaza", "-o", "/data/plaza-7", "--seed", "7",
                          "--duration", "12.5", "--gray", "--reuse"));
}

TEST(Plan, EveryRowOnEverySequence) {
  const std::vector<Sequence> sequences = {
      {.name = "a/s", .recording = "/data/a/s", .reference = {}}};
  const std::vector<AblationRow> rows = {{.name = "r", .settings = {"k=false"}},
                                         {.name = "r+o", .settings = {"k=true"}}};
  const auto runs =
      plan_runs(sequences, rows, {.program = "/bin/geoflow", .output = "out", .settings = {"x=1"}});
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_THAT(runs[1].arguments, ElementsAre("/bin/geoflow", "replay", "/data/a/s", "-o",
                                             "out/a/s/r+o", "--set", "x=1", "--set", "k=true"));
}

TEST(Plan, AnEarlierResultDoesNotStandForThisOne) {
  const tests::TemporaryDirectory folder;
  touch(folder.path() / "report.json");
  touch(folder.path() / "final_camera.txt");
  const auto command = prepare({.output = folder.path(), .arguments = {"x"}});
  ASSERT_TRUE(command) << command.error().message;
  EXPECT_FALSE(fs::exists(folder.path() / "report.json"));
  EXPECT_FALSE(fs::exists(folder.path() / "final_camera.txt"));
  EXPECT_EQ(command->log, folder.path() / "log.txt");
}

/// A walk along a bent path, `shift_m` to the side of it after half the way.
Trajectory walk(double shift_m) {
  Trajectory poses;
  constexpr int kFrames = 300;
  for (int i = 0; i < kFrames; ++i) {
    const double t_s = i / 30.0;
    const double side_m = i < kFrames / 2 ? 0 : shift_m;
    poses.push_back({HostTime{from_seconds(t_s)},
                     SE3{so3::exp({0, 0, 0.1 * t_s}), {t_s, std::sin(t_s) + side_m, 0.2 * t_s}}});
  }
  return poses;
}

class Judge : public testing::Test {
 protected:
  Outcome judge_walk(const Trajectory& estimate, const JudgeOptions& options = {}) {
    EXPECT_TRUE(write_tum(folder_.path() / "final_camera.txt", estimate));
    std::ofstream{folder_.path() / "report.json"} << report_;
    return judge({.name = "s", .recording = {}, .reference = {}}, "r", truth_, folder_.path(),
                 options);
  }

  std::string report_ =
      R"({"frames": 300, "tracked": 290, "times_ms": {"process": {"mean": 12.5}}})";
  tests::TemporaryDirectory folder_;
  Result<TrajectoryFile> truth_{TrajectoryFile{
      .poses = walk(0), .format = TrajectoryFormat::kTum, .matrices = {}, .warnings = {}}};
};

TEST_F(Judge, APerfectRun) {
  const Outcome outcome = judge_walk(walk(0));
  EXPECT_EQ(outcome.failure, "");
  EXPECT_NEAR(outcome.ate_m, 0, 1e-6);
  EXPECT_NEAR(outcome.rte_m, 0, 1e-6);
  EXPECT_NEAR(outcome.correct_rate, 1, 1e-9);
  EXPECT_EQ(outcome.frames, 300);
  EXPECT_EQ(outcome.tracked, 290);
  EXPECT_EQ(outcome.frame_ms, 12.5);
}

TEST_F(Judge, AJumpIsAnErrorOfTheWholeAndOfOneFrame) {
  const Outcome outcome = judge_walk(walk(0.3));
  EXPECT_EQ(outcome.failure, "");
  EXPECT_GT(outcome.ate_m, 0.03);
  EXPECT_LT(outcome.ate_m, 0.15);
  EXPECT_NEAR(outcome.rte_m, 0.3 / std::sqrt(299.0), 0.002);  // one of 299 steps is 0.3 m off
}

TEST_F(Judge, HalfARunHasFailed) {
  Trajectory half = walk(0);
  half.resize(100);
  const Outcome outcome = judge_walk(half);
  EXPECT_THAT(outcome.failure, HasSubstr("of the time only"));
  EXPECT_LT(outcome.coverage, 0.5);
}

TEST_F(Judge, TruthBeforeAndAfterTheRecordingDoesNotCount) {
  Trajectory half = walk(0);
  half.resize(100);
  EXPECT_NE(judge_walk(half).failure, "");
  report_ = R"({"input": {"start_ns": 0, "end_ns": 3300000000}})";
  const Outcome outcome = judge_walk(half);
  EXPECT_EQ(outcome.failure, "");
  EXPECT_NEAR(outcome.coverage, 1, 0.01);
}

TEST_F(Judge, PosesFarFromTheTruthDoNotCount) {
  EXPECT_EQ(judge_walk(walk(0.3), {.correct_within_m = 0.5}).failure, "");
  EXPECT_THAT(judge_walk(walk(0.3), {.correct_within_m = 0.001}).failure,
              HasSubstr("within 0.001 m"));
}

TEST_F(Judge, NoResultSaysWhatTheRunSaid) {
  std::ofstream{folder_.path() / "log.txt"} << "geoflow replay: rgb.txt:3: not there\n\n";
  const Outcome outcome =
      judge({.name = "s", .recording = {}, .reference = {}}, "r", truth_, folder_.path(), {});
  EXPECT_EQ(outcome.failure, "geoflow replay: rgb.txt:3: not there");
  EXPECT_TRUE(std::isnan(outcome.ate_m));
}

TEST_F(Judge, ATruthThatCannotBeReadIsTheFailure) {
  truth_ = fail(ErrorCode::kNotFound, "groundtruth.txt: not there");
  EXPECT_EQ(judge_walk(walk(0)).failure, "groundtruth.txt: not there");
}

Outcome outcome_of(const std::string& sequence, double ate_m, const std::string& failure = "") {
  return {.sequence = sequence,
          .row = "r+o",
          .failure = failure,
          .ate_m = ate_m,
          .rte_m = 0.01,
          .correct_rate = 0.9,
          .coverage = 1,
          .frame_ms = 10,
          .frames = 5,
          .tracked = 5};
}

TEST(SummaryTable, MeansLeaveFailuresOutAndCountThem) {
  const auto summary = to_json(
      summary_table(Suite::kTum,
                    {outcome_of("a", 0.1), outcome_of("b", 0.3), outcome_of("c", 9, "lost")}),
      this_machine());
  ASSERT_EQ(summary["rows"].size(), 1U);
  EXPECT_EQ(summary["rows"][0]["sequences"], 3);
  EXPECT_EQ(summary["rows"][0]["failures"], 1);
  EXPECT_NEAR(summary["rows"][0]["ate_m"].get<double>(), 0.2, 1e-12);
  EXPECT_TRUE(summary["rows"][0]["paper_ate_m"].is_null());
}

TEST(SummaryTable, TableIIIStandsThereOnceItsSequencesAreAll) {
  std::vector<Outcome> outcomes = {outcome_of("rgbd_dataset_freiburg1_xyz", 1)};
  for (const char* const name :
       {"long_office_household", "nostructure_texture_far", "nostructure_texture_near_withloop",
        "structure_notexture_far", "structure_notexture_near", "structure_texture_far"}) {
    outcomes.push_back(outcome_of(fmt::format("rgbd_dataset_freiburg3_{}", name), 0.02));
  }
  EXPECT_EQ(summary_table(Suite::kTum, outcomes).rows.size(), 1U);
  outcomes.push_back(outcome_of("rgbd_dataset_freiburg3_structure_texture_near", 0.02));
  const auto summary = to_json(summary_table(Suite::kTum, outcomes), this_machine());
  ASSERT_EQ(summary["rows"].size(), 2U);
  EXPECT_EQ(summary["rows"][1]["set"], "table III");
  EXPECT_EQ(summary["rows"][1]["sequences"], 7);
  EXPECT_NEAR(summary["rows"][1]["ate_m"].get<double>(), 0.02, 1e-12);
  EXPECT_EQ(summary["rows"][1]["paper_ate_m"], 0.0142);
}

TEST(SequenceTable, HasThePapersFigureBesideTheMeasuredOne) {
  const auto table = to_json(
      sequence_table(Suite::kTum, {outcome_of("x/rgbd_dataset_freiburg1_xyz", 0.5, "lost")}),
      this_machine());
  EXPECT_EQ(table["rows"][0]["paper_ate_m"], 0.0101);
  EXPECT_EQ(table["rows"][0]["failure"], "lost");
}

}  // namespace
}  // namespace geoflow::tools
