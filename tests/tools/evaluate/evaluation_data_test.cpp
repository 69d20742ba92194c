#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

/// Published trajectories with published figures.
namespace geoflow::tools {
namespace {

Evaluation evaluated(const std::filesystem::path& folder, const std::string& estimate,
                     const std::string& reference, const EvaluationOptions& options) {
  const auto est = read_trajectory(folder / estimate);
  const auto ref = read_trajectory(folder / reference);
  if (!est || !ref) {
    throw std::runtime_error{(est ? ref : est).error().message};
  }
  auto result = evaluate(*est, *ref, options);
  if (!result) {
    throw std::runtime_error{result.error().message};
  }
  return *std::move(result);
}

void expect_evo(const Statistics& ours, const std::filesystem::path& path) {
  std::ifstream stream{path};
  const auto evo = nlohmann::json::parse(stream);
  const auto expect = [&](const char* key, double value) {
    const double truth = evo.at(key).get<double>();
    EXPECT_NEAR(value, truth, 1e-6 * truth) << key;
  };
  expect("rmse", ours.rmse);
  expect("mean", ours.mean);
  expect("median", ours.median);
  expect("std", ours.std);
  expect("min", ours.min);
  expect("max", ours.max);
  expect("sse", ours.sse);
}

TEST(Evo, AbsoluteErrorsOfKitti00AreReproduced) {
  GEOFLOW_DATA_OR_SKIP(folder, "trajectories");
  const auto result = evaluated(folder, "KITTI_00_ORB.txt", "KITTI_00_gt.txt", {});
  expect_evo(result.ate.translation_m, folder / "evo_orb_ape.stats.json");
}

TEST(Evo, RelativeErrorsOfKitti00AreReproduced) {
  GEOFLOW_DATA_OR_SKIP(folder, "trajectories");
  const auto result = evaluated(
      folder, "KITTI_00_ORB.txt", "KITTI_00_gt.txt",
      {.alignment = Alignment::kNone, .relative = {.delta = 10, .unit = DeltaUnit::kMetres}});
  expect_evo(result.rpe.translation_m, folder / "evo_orb_rpe.stats.json");
}

/// The benchmark's evaluate_ate.py gives 0.013473 m for its example, pairing within 0.02 s.
TEST(TumBenchmark, ExampleOfFreiburg1XyzHasItsPublishedError) {
  GEOFLOW_DATA_OR_SKIP(folder, "trajectories");
  const EvaluationOptions options{.association = {.max_difference = std::chrono::milliseconds{20}}};
  const auto result =
      evaluated(folder, "freiburg1_xyz-rgbdslam.txt", "freiburg1_xyz-groundtruth.txt", options);
  EXPECT_NEAR(result.ate.translation_m.rmse, 0.01347, 0.00005);
  EXPECT_NEAR(static_cast<double>(result.pairs.size()), 786, 2);
  // The camera's axes are rotated against each other by less than 4 degrees, the hand moves less
  // than 1 m a second.
  EXPECT_LT(result.ate.rotation_deg.max, 4);
  EXPECT_GT(result.rpe.translation_m.count, 20U);
  EXPECT_LT(result.rpe.translation_m.max, 0.06);
  EXPECT_NEAR(result.path.reference_m, 8.0, 0.2);
  // The same path seen in another frame.
  const auto moved = evaluated(folder, "freiburg1_xyz-rgbdslam_drift.txt",
                               "freiburg1_xyz-groundtruth.txt", options);
  EXPECT_NEAR(moved.ate.translation_m.rmse, result.ate.translation_m.rmse, 1e-6);
}

/// ORB-SLAM2 reports 0.009 m (RGB-D) and 0.008 m (monocular, scaled) on this sequence.
TEST(TumBenchmark, OrbSlamOnFreiburg2DeskIsWithinACentimetre) {
  GEOFLOW_DATA_OR_SKIP(folder, "trajectories");
  const auto rigid = evaluated(folder, "fr2_desk_ORB.txt", "fr2_desk_groundtruth.txt", {});
  EXPECT_GT(rigid.ate.translation_m.rmse, 0.004);
  EXPECT_LT(rigid.ate.translation_m.rmse, 0.010);
  const auto scaled = evaluated(folder, "fr2_desk_ORB.txt", "fr2_desk_groundtruth.txt",
                                {.alignment = Alignment::kSim3, .coverage = {.max_error_m = 0.02}});
  EXPECT_LT(scaled.ate.translation_m.rmse, rigid.ate.translation_m.rmse);
  EXPECT_NEAR(scaled.alignment.scale, 1.0, 0.01);
  ASSERT_TRUE(scaled.correct_rate);
  EXPECT_GT(*scaled.correct_rate, 0.8);
  EXPECT_LE(*scaled.correct_rate, scaled.coverage);
}

TEST(Evaluate, OfAFileWithItselfHasNoError) {
  GEOFLOW_DATA_OR_SKIP(folder, "euroc-v102");
  const auto result = evaluated(folder, "groundtruth.csv", "groundtruth.csv", {});
  EXPECT_LT(result.ate.translation_m.max, 1e-9);
  EXPECT_LT(result.rpe.translation_m.max, 1e-9);
  EXPECT_GT(result.coverage, 0.999);
}

}  // namespace
}  // namespace geoflow::tools
