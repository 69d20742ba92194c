#include "geoflow/tools/verb.hpp"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "tools/verb_fixture.hpp"

namespace geoflow::tools {

// NOLINTNEXTLINE(misc-use-internal-linkage): the verb's library defines it
std::unique_ptr<Verb> make_report_verb();

namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr int kFrames = 120;
/// A recording's name that would be markup, were it taken for it.
constexpr std::string_view kRecording = "<b>bag<b>";

HostTime time_of(int frame) {
  return HostTime{std::chrono::seconds{1000} + std::chrono::milliseconds{33} * frame};
}

/// A run beside its truth, and the recording that it is of: an IMU that paused once.
class ReportVerbTest : public tests::VerbTest {
 protected:
  ReportVerbTest() : VerbTest{make_report_verb} {
    std::filesystem::create_directories(folder_.path() / "run");
    std::filesystem::create_directories(folder_.path() / kRecording);
    write_run();
    write_recording();
    put("run/report.json", report().dump());
  }

  void write_run() const {
    const SE3 T_base_cam = SE3::exp((Vector6d{} << -1.2, 1.2, -1.2, 0.3, 0.02, 0.05).finished());
    std::vector<PoseEstimate> estimates;
    Trajectory base;
    Trajectory camera;
    Trajectory truth;
    for (int i = 0; i < kFrames; ++i) {
      const double s = 0.05 * i;
      const SE3 pose = SE3::exp((Vector6d{} << 0, 0, 0.02 * i, s, 0.3 * std::sin(s), 0).finished());
      const SE3 error = SE3::exp(
          (Vector6d{} << 0, 0, 0.002 * std::sin(3 * s), 0.02 * std::cos(s), 0, 0).finished());
      const SE3 estimated = pose * error;
      base.push_back({time_of(i), estimated});
      camera.push_back({time_of(i), estimated * T_base_cam});
      truth.push_back({time_of(i), pose * T_base_cam});
      PoseEstimate estimate;
      estimate.t = time_of(i);
      estimate.T_odom_base = estimated;
      estimate.covariance.diagonal().setConstant(1e-4);
      estimate.status = i / 40 == 1 ? TrackingStatus::kDegraded : TrackingStatus::kTracking;
      estimate.quality = static_cast<std::uint8_t>(60 + i / 4);
      estimates.push_back(estimate);
    }
    EXPECT_TRUE(write_estimates(file("run/estimates.csv"), estimates));
    for (const char* which : {"live", "final"}) {
      EXPECT_TRUE(write_tum(file(fmt::format("run/{}_base.txt", which)), base));
      EXPECT_TRUE(write_tum(file(fmt::format("run/{}_camera.txt", which)), camera));
    }
    EXPECT_TRUE(write_tum(file("groundtruth.txt"), truth));
  }

  void write_recording() const {
    std::string imu = "#timestamp [ns],w,w,w,a,a,a\n";
    for (int i = 0; i < 300; ++i) {
      if (i < 100 || i > 103) {
        imu += fmt::format("{},0,0,0,0,0,9.81\n", 1'000'000'000'000 + 5'000'000LL * i);
      }
    }
    put(std::string{kRecording} + "/imu.csv", imu);
  }

  [[nodiscard]] json report() const {
    const json times{{"count", 120}, {"mean", 10}, {"p50", 9.5}, {"p99", 20}, {"max", 33}};
    return {{"version", "0.1.0"},
            {"frames", kFrames},
            {"tracked", kFrames},
            {"by_status", {{"TRACKING", 80}, {"DEGRADED", 40}, {"LOST", 0}}},
            {"drops", {{"color", 3}}},
            {"input", {{"path", file(std::string{kRecording})}}},
            {"times_ms", {{"process", times}}},
            {"time_histograms_ms", {{"process", {{9, 10, 100}, {19, 20, 20}}}}},
            {"faults", {{"drop", {{"imu", 4}}}}},
            {"synchroniser", {{"imu", {{"late", 2}, {"used", 290}}}}},
            {"configuration", {{"slam.switches.gicp", "true"}}}};
  }

  void put(const std::string& name, const std::string& text) const {
    std::ofstream{file(name), std::ios::binary} << text;
  }

  [[nodiscard]] std::string content(const std::string& name) const {
    std::ifstream stream{file(name), std::ios::binary};
    return {std::istreambuf_iterator<char>{stream}, {}};
  }

  /// What the page is drawn from.
  [[nodiscard]] json page_data() const {
    const std::string page = content("page/report.html");
    const std::string_view open = "<script type=\"application/json\" id=\"data\">";
    const std::size_t begin = page.find(open) + open.size();
    return json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  }

  [[nodiscard]] static const json& section(const json& data, const std::string& heading) {
    for (const json& one : data.at("sections")) {
      if (one.at("heading") == heading) {
        return one;
      }
    }
    ADD_FAILURE() << "no section " << heading;
    return data;
  }

  void expect_refused(const std::string& message) {
    EXPECT_EQ(run({file("run"), "-o", file("page")}), 3);
    EXPECT_THAT(err_, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(file("page")));
  }
};

TEST_F(ReportVerbTest, SaysWhatEvaluateSays) {
  ASSERT_EQ(
      run({file("run"), "-o", file("page"), "--reference", file("groundtruth.txt"), "--json"}), 0)
      << err_;
  const json said = json::parse(out_);
  const auto truth = read_trajectory(file("groundtruth.txt"));
  const auto live = read_trajectory(file("run/live_camera.txt"));
  const EvaluationOptions options;
  EXPECT_EQ(said.at("live"), to_json(evaluate(*live, *truth, options).value(), options));
  EXPECT_GT(said.at("live").at("ate").at("translation_m").at("rmse"), 0.001);
  // The truth of the camera was turned into the base's for the covariances: only these errors are
  // there, 20 mm (1 - cos) along x after the first pair.
  const json& tracking = said.at("consistency").at("TRACKING");
  EXPECT_EQ(tracking.at("estimates"), 79);
  EXPECT_LT(tracking.at("nees_pose"), 3);
  EXPECT_GT(tracking.at("nees_pose"), 0.1);
}

TEST_F(ReportVerbTest, ThePageHasAPlotForEachQuestion) {
  ASSERT_EQ(run({file("run"), "-o", file("page"), "--reference", file("groundtruth.txt")}), 0)
      << err_;
  const json data = page_data();
  EXPECT_EQ(data.at("title"), kRecording);
  EXPECT_THAT(data.at("warnings"), testing::IsEmpty());
  for (const char* heading :
       {"Final trajectory against the reference", "Live trajectory against the reference",
        "Relative error over time", "Error beside the claimed covariance", "Status and health",
        "Times of the stages", "Sensor gaps of the recording"}) {
    const json& one = section(data, heading);
    EXPECT_FALSE(one.at("figure").at("axes").empty()) << heading;
    EXPECT_THAT(content("page/" + one.at("png").get<std::string>()), StartsWith("\x89PNG"));
  }
  const json& gaps = section(data, "Sensor gaps of the recording").at("tables").at(0).at("rows");
  EXPECT_EQ(gaps, json::parse(R"([["imu", "296", "5.000", "25.000", "1", "4"]])"));
  const json& losses = section(data, "Status and health").at("tables").at(1).at("rows");
  EXPECT_EQ(losses.size(), 3U);
  EXPECT_EQ(section(data, "Error beside the claimed covariance").at("figure").at("axes").size(),
            7U);
}

TEST_F(ReportVerbTest, ThePageNeedsNothingElse) {
  ASSERT_EQ(run({file("run"), "-o", file("page"), "--reference", file("groundtruth.txt")}), 0)
      << err_;
  const std::string page = content("page/report.html");
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("http://")));
  EXPECT_THAT(page, Not(HasSubstr("https://")));
  EXPECT_THAT(page, Not(HasSubstr("{{")));
  EXPECT_THAT(page, Not(HasSubstr(std::string{kRecording})));
  ASSERT_EQ(run({file("run"), "-o", file("page"), "--reference", file("groundtruth.txt")}), 0);
  EXPECT_EQ(content("page/report.html"), page) << "the same run gives the same page";
}

TEST_F(ReportVerbTest, WithoutATruthOrRecordingThePageSaysWhatItLacks) {
  std::filesystem::remove_all(folder_.path() / kRecording);
  ASSERT_EQ(run({file("run"), "-o", file("page")}), 0) << err_;
  const json data = page_data();
  ASSERT_EQ(data.at("warnings").size(), 2U);
  EXPECT_THAT(data.at("warnings").at(0).get<std::string>(), HasSubstr("--reference"));
  EXPECT_THAT(data.at("warnings").at(1).get<std::string>(), StartsWith("No sensor gaps: "));
  EXPECT_THAT(err_, HasSubstr("No comparison with the truth"));
  EXPECT_TRUE(section(data, "Status and health").contains("figure"));
}

TEST_F(ReportVerbTest, TakesTheTruthThatLiesWithTheRecording) {
  for (const char* list : {"/rgb.txt", "/depth.txt"}) {
    put(std::string{kRecording} + list, "");
  }
  std::filesystem::copy_file(file("groundtruth.txt"),
                             file(std::string{kRecording} + "/groundtruth.txt"));
  ASSERT_EQ(run({file("run"), "-o", file("page"), "--json"}), 0) << err_;
  EXPECT_EQ(json::parse(out_).at("reference"), file(std::string{kRecording} + "/groundtruth.txt"));
}

TEST_F(ReportVerbTest, ShowsTheAblationThatWasMeasured) {
  put("table.json", R"({"summary": [{"set": "all", "row": "r+o", "sequences": 5, "failures": 0,
                                     "ate_m": 0.0251, "paper_ate_m": null}]})");
  ASSERT_EQ(run({file("run"), "-o", file("page"), "--table", file("table.json")}), 0) << err_;
  const json data = page_data();
  const json& row = section(data, "Component ablation").at("tables").at(0).at("rows").at(0);
  EXPECT_EQ(row.at(1), "r+o");
  EXPECT_EQ(row.at(4), "0.0251");
  EXPECT_EQ(row.at(8), "");
  put("table.json", R"({"rows": []})");
  EXPECT_EQ(run({file("run"), "-o", file("page"), "--table", file("table.json")}), 3);
  EXPECT_THAT(err_, HasSubstr("table.json: the key \"summary\" should be an array"));
}

TEST_F(ReportVerbTest, ARunThatIsDamagedIsNamedWithItsPlace) {
  put("run/report.json", R"({"frames": )");
  expect_refused("run/report.json: ");
  put("run/report.json", "[]");
  expect_refused("run/report.json: is no JSON object");
  json wrong = report();
  wrong["frames"] = "many";
  put("run/report.json", wrong.dump());
  expect_refused("the key \"frames\" should be a number");
  wrong = report();
  wrong["times_ms"]["process"].erase("p99");
  put("run/report.json", wrong.dump());
  expect_refused("the key \"times_ms\".\"process\".\"p99\" should be a number");
  wrong = report();
  wrong["input"] = {{"path", 3}};
  put("run/report.json", wrong.dump());
  expect_refused("the key \"input\".\"path\" should be a text");
  put("run/report.json", report().dump());
  put("run/live_base.txt", "1 2 3\n");
  expect_refused("live_base.txt:1");
  put("run/estimates.csv", "1,2\n");
  expect_refused("estimates.csv:1: expected the 34 columns");
  std::filesystem::remove(file("run/report.json"));
  expect_refused("report.json: No such file");
}

TEST_F(ReportVerbTest, ATruthThatWasNamedMustDo) {
  EXPECT_EQ(run({file("run"), "-o", file("page"), "--reference", file("none.txt")}), 3);
  EXPECT_THAT(err_, HasSubstr("none.txt"));
  put("far.txt", "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n3 1 1 0 0 0 0 1\n");
  EXPECT_EQ(run({file("run"), "-o", file("page"), "--reference", file("far.txt")}), 3);
}

TEST_F(ReportVerbTest, HistogramsOfAnotherFormAreLeftOut) {
  json other = report();
  other["time_histograms_ms"] = {{"process", {{1, 2}}}, {"flow", 3}, {"cloud", {{5, 5, 1}}}};
  put("run/report.json", other.dump());
  ASSERT_EQ(run({file("run"), "-o", file("page")}), 0) << err_;
  const json data = page_data();
  EXPECT_FALSE(section(data, "Times of the stages").contains("figure"));
}

}  // namespace
}  // namespace geoflow::tools
