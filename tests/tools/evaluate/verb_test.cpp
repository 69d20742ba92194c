#include "geoflow/tools/verb.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/estimate_table.hpp"

#include "tools/verb_fixture.hpp"

namespace geoflow::tools {

// NOLINTNEXTLINE(misc-use-internal-linkage): the verb's library defines it
std::unique_ptr<Verb> make_evaluate_verb();

namespace {

using testing::HasSubstr;
using testing::StartsWith;

class EvaluateVerbTest : public tests::VerbTest {
 protected:
  EvaluateVerbTest() : VerbTest{make_evaluate_verb} {
    std::ofstream reference{folder_.path() / "reference.txt"};
    std::ofstream estimate{folder_.path() / "estimate.txt"};
    for (int i = 0; i < 40; ++i) {
      const double t = 0.1 * i;
      reference << t << " " << t << " " << t * t << " 0 0 0 0 1\n";
      estimate << t << " " << t << " " << t * t << " " << (i % 2 == 0 ? 0.01 : -0.01)
               << " 0 0 0 1\n";
    }
  }

  [[nodiscard]] std::string content(const std::string& name) const {
    std::ifstream stream{file(name), std::ios::binary};
    return {std::istreambuf_iterator<char>{stream}, {}};
  }
};

TEST_F(EvaluateVerbTest, PrintsJsonWithItsDocumentedKeys) {
  ASSERT_EQ(run({file("estimate.txt"), file("reference.txt"), "--align", "none", "--correct-within",
                 "0.02", "--json"}),
            0)
      << err_;
  const auto json = nlohmann::json::parse(out_);
  EXPECT_NEAR(json.at("ate").at("translation_m").at("rmse").get<double>(), 0.01, 1e-9);
  EXPECT_EQ(json.at("ate").at("rotation_deg").at("max"), 0.0);
  EXPECT_EQ(json.at("pairs"), 40);
  EXPECT_NEAR(json.at("duration_s").get<double>(), 3.9, 1e-9);
  EXPECT_EQ(json.at("estimate").at("format"), "tum");
  EXPECT_EQ(json.at("rpe").at("unit"), "s");
  EXPECT_EQ(json.at("alignment").at("kind"), "none");
  EXPECT_EQ(json.at("correct_rate").at("rate"), 1.0);
  EXPECT_NEAR(json.at("path_m").at("reference").get<double>(), 16.06, 0.5);
}

TEST_F(EvaluateVerbTest, SaysHowHonestCovariancesAre) {
  std::vector<PoseEstimate> estimates(40);
  for (int i = 0; i < 40; ++i) {
    PoseEstimate& estimate = estimates.at(static_cast<std::size_t>(i));
    estimate.t = HostTime{std::chrono::milliseconds{100 * i}};
    // 30 mm off along x but for the first pose, where 10 mm are expected.
    estimate.T_odom_base = SE3{Eigen::Quaterniond::Identity(),
                               Vector3d{0.1 * i + (i > 0 ? 0.03 : 0), 0.01 * i * i, 0}};
    estimate.covariance.diagonal().setConstant(1e-4);
    estimate.status = i < 20 ? TrackingStatus::kTracking : TrackingStatus::kDegraded;
  }
  ASSERT_TRUE(write_estimates(file("estimates.csv"), estimates));
  const std::vector<std::string> arguments{file("estimate.txt"), file("reference.txt"),
                                           "--estimates", file("estimates.csv")};
  std::vector<std::string> as_json = arguments;
  as_json.emplace_back("--json");
  ASSERT_EQ(run(as_json), 0) << err_;
  const auto rows = nlohmann::json::parse(out_).at("consistency");
  EXPECT_EQ(rows.at("TRACKING").at("estimates"), 19);
  EXPECT_EQ(rows.at("DEGRADED").at("estimates"), 20);
  EXPECT_NEAR(rows.at("DEGRADED").at("nees_position").get<double>(), 3, 1e-3);
  EXPECT_NEAR(rows.at("DEGRADED").at("nees_orientation").get<double>(), 0, 1e-9);
  EXPECT_NEAR(rows.at("DEGRADED").at("nees_pose").get<double>(), 1.5, 1e-3);
  EXPECT_EQ(rows.at("DEGRADED").at("within_95"), 1.0);
  ASSERT_EQ(run(arguments), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("NEES"));
}

TEST_F(EvaluateVerbTest, PrintsATable) {
  ASSERT_EQ(run({file("estimate.txt"), file("reference.txt")}), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("absolute error"));
  EXPECT_THAT(out_, HasSubstr("relative error over 1 s"));
  EXPECT_THAT(out_, HasSubstr("alignment  se3"));
}

TEST_F(EvaluateVerbTest, WritesPlotsAndTheTable) {
  ASSERT_EQ(run({file("estimate.txt"), file("reference.txt"), "--plot", file("a.png"), "--table",
                 file("a.csv")}),
            0)
      << err_;
  ASSERT_EQ(run({file("estimate.txt"), file("reference.txt"), "--plot", file("a.svg")}), 0) << err_;
  EXPECT_THAT(content("a.png"), StartsWith("\x89PNG"));
  EXPECT_THAT(content("a.svg"), HasSubstr("<svg"));
  const std::string csv = content("a.csv");
  EXPECT_THAT(csv, StartsWith("timestamp_ns,estimate_x_m"));
  EXPECT_EQ(std::ranges::count(csv, '\n'), 41);
}

TEST_F(EvaluateVerbTest, ExitsWithItsDocumentedCodes) {
  EXPECT_EQ(run({file("estimate.txt"), file("reference.txt"), "--max-ate", "0.02"}), 0);
  EXPECT_EQ(run({file("estimate.txt"), file("reference.txt"), "--max-ate", "0.001"}), 1);
  EXPECT_THAT(err_, HasSubstr("is above 0.001 m"));
  EXPECT_EQ(run({file("estimate.txt"), file("reference.txt"), "--align", "mirror"}), 2);
  EXPECT_EQ(run({file("estimate.txt"), file("reference.txt"), "--delta", "-1"}), 2);
  EXPECT_EQ(run({file("estimate.txt"), file("reference.txt"), "--plot", file("a.bmp")}), 2);
  EXPECT_EQ(run({file("estimate.txt")}), 2);
  EXPECT_EQ(run({file("estimate.txt"), file("none.txt")}), 3);
  EXPECT_THAT(err_, HasSubstr("none.txt"));
  std::ofstream{file("garbage.txt")} << "\x7f" << "ELF \x01\x02\n";
  EXPECT_EQ(run({file("garbage.txt"), file("reference.txt"), "--json"}), 3);
  EXPECT_EQ(nlohmann::json::parse(out_).at("error").at("code"), "invalid_data");
  EXPECT_THAT(err_, HasSubstr("garbage.txt:1:"));
}

TEST_F(EvaluateVerbTest, ShowsExamples) {
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_THAT(out_, HasSubstr("--max-difference"));
  EXPECT_THAT(out_, HasSubstr("geoflow evaluate out/final_camera.txt groundtruth.txt"));
}

}  // namespace
}  // namespace geoflow::tools
