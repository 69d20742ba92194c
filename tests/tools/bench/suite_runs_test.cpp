#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <ios>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/bench/processes.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/simulation.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

#include "simulate/settings.hpp"
#include "simulate/writer.hpp"

// `geoflow bench table` on one short walk, laid out as each suite's data sets are.
namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream{file, std::ios::binary}.rdbuf();
  return text.str();
}

void write(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream{file, std::ios::binary} << text;
}

std::string row_major(const SE3& pose) {
  std::string text;
  const Eigen::Matrix4d matrix = pose.matrix();
  for (int i = 0; i < matrix.size(); ++i) {
    text += fmt::format("{}{:.9f}", i == 0 ? "" : ", ", matrix(i / 4, i % 4));
  }
  return text;
}

template <typename Value>
void put(std::string& bytes, const Value& value) {
  bytes.append(sizeof value, '\0');
  std::memcpy(bytes.data() + bytes.size() - sizeof value, &value, sizeof value);
}

void put_matrix(std::string& bytes, const Eigen::Matrix4d& matrix) {
  for (int i = 0; i < matrix.size(); ++i) {
    put(bytes, static_cast<float>(matrix(i / 4, i % 4)));
  }
}

class SuiteRuns : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<tests::TemporaryDirectory>();
    simulator::SimulationOptions options{.scene = "office", .seed = 1, .duration_s = 2};
    for (const char* const setting : {"camera.width=320", "camera.height=240", "robot.stand_s=0.8",
                                      "recording.frame_rate_hz=15"}) {
      ASSERT_TRUE(set_knob(options, setting));
    }
    auto simulation = simulator::Simulation::create(options);
    ASSERT_TRUE(simulation) << simulation.error().message;
    calibration_ = (*simulation)->calibration();
    const auto written =
        write_simulation(**simulation, {.directory = walk(), .tum = true},
                         [](std::size_t /*done*/, std::size_t /*total*/) { return true; });
    ASSERT_TRUE(written) << written.error().message;
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static fs::path walk() { return folder_->path() / "walk"; }
  [[nodiscard]] fs::path data() const { return scratch_.path() / "data"; }
  [[nodiscard]] fs::path output() const { return scratch_.path() / "out"; }

  [[nodiscard]] std::vector<std::string> table(const std::string& suite) const {
    return {GEOFLOW_PROGRAM, "bench", "table",           "--suite", suite,      "--data",
            data().string(), "-o",    output().string(), "--rows",  "r,r+o+i+d"};
  }

  /// Runs a command, which must end well, and says what it printed.
  // NOLINTNEXTLINE(modernize-use-nodiscard): what it prints matters to few
  std::string run(const std::vector<std::string>& arguments) const {
    const Command command{.arguments = arguments, .log = scratch_.path() / "log.txt"};
    const auto ended = run_processes({&command, 1}, 1, [](std::size_t /*done*/) { return true; });
    EXPECT_TRUE(ended && ended->front().well()) << content(command.log);
    return content(command.log);
  }

  /// Of the two rows of the one sequence that there is.
  void expect_good_rows(const std::string& sequence) const {
    const auto saved = nlohmann::json::parse(content(output() / "table.json"), nullptr, false);
    ASSERT_TRUE(saved.is_object());
    ASSERT_EQ(saved["rows"].size(), 2U);
    EXPECT_EQ(saved["rows"][0]["row"], "r");
    EXPECT_EQ(saved["rows"][1]["row"], "r+o+i+d");
    for (const auto& row : saved["rows"]) {
      EXPECT_EQ(row["sequence"], sequence);
      EXPECT_EQ(row["failure"], "");
      EXPECT_EQ(row["frames"], 31);
      EXPECT_LT(row["ate_m"].get<double>(), 0.03);
      EXPECT_GT(row["correct_rate"].get<double>(), 0.9);
    }
  }

  static inline std::unique_ptr<tests::TemporaryDirectory> folder_;
  static inline Calibration calibration_;
  tests::TemporaryDirectory scratch_;
};

TEST_F(SuiteRuns, Tum) {
  fs::create_directories(data() / "deep");
  fs::copy(walk() / "tum", data() / "deep" / "sequence", fs::copy_options::recursive);
  run(table("tum"));
  expect_good_rows("deep/sequence");
}

TEST_F(SuiteRuns, OpenLoris) {
  const fs::path package = data() / "office1-1";
  fs::create_directories(package);
  fs::copy(walk() / "tum" / "rgb", package / "rgb");
  fs::copy(walk() / "tum" / "depth", package / "depth");
  fs::copy(walk() / "tum" / "rgb.txt", package / "color.txt");
  fs::copy(walk() / "tum" / "depth.txt", package / "aligned_depth.txt");
  fs::copy(walk() / "groundtruth_base.txt", package / "groundtruth.txt");
  const CameraIntrinsics& camera = calibration_.camera;
  write(package / "sensors.yaml",
        fmt::format("%YAML:1.0\n---\nd400_color_optical_frame:\n   width: {}\n   height: {}\n"
                    "   intrinsics: !!opencv-matrix\n      rows: 1\n      cols: 4\n      dt: d\n"
                    "      data: [ {}, {}, {}, {} ]\n",
                    camera.width, camera.height, camera.fx, camera.cx, camera.fy, camera.cy));
  write(package / "trans_matrix.yaml",
        fmt::format("%YAML:1.0\n---\ntrans_matrix:\n   -\n      parent_frame: base_link\n"
                    "      child_frame: d400_color_optical_frame\n"
                    "      matrix: !!opencv-matrix\n         data: [ {} ]\n",
                    row_major(simulator::go2_T_base_cam())));
  run(table("openloris"));
  expect_good_rows("office1-1");
}

/// ScanNet's own format, version 4: PNG colour, raw depth, poses beside each image.
TEST_F(SuiteRuns, ScanNet) {
  constexpr std::int32_t kPng = 1;
  constexpr std::int32_t kRawDepth = 0;
  const auto truth = read_trajectory(walk() / "groundtruth.txt");
  ASSERT_TRUE(truth);
  const CameraIntrinsics& camera = calibration_.camera;
  Eigen::Matrix4d K = Eigen::Matrix4d::Identity();
  K(0, 0) = camera.fx;
  K(1, 1) = camera.fy;
  K(0, 2) = camera.cx;
  K(1, 2) = camera.cy;
  const std::string name = "made up";
  std::string bytes;
  put(bytes, std::uint32_t{4});
  put(bytes, std::uint64_t{name.size()});
  bytes += name;
  for (const Eigen::Matrix4d& matrix : {K, Eigen::Matrix4d{Eigen::Matrix4d::Identity()}, K,
                                        Eigen::Matrix4d{Eigen::Matrix4d::Identity()}}) {
    put_matrix(bytes, matrix);
  }
  put(bytes, kPng);
  put(bytes, kRawDepth);
  for (const int side : {camera.width, camera.height, camera.width, camera.height}) {
    put(bytes, static_cast<std::uint32_t>(side));
  }
  put(bytes, 1000.0F);  // counts a metre
  put(bytes, std::uint64_t{truth->poses.size()});
  for (const auto& [t, pose] : truth->poses) {
    const auto us = static_cast<std::uint64_t>(t.time_since_epoch().count() / 1000);
    const std::string stamp =
        fmt::format("{:.9f}.png", static_cast<double>(t.time_since_epoch().count()) * 1e-9);
    const std::string color = content(walk() / "tum" / "rgb" / stamp);
    const cv::Mat depth =
        cv::imread((walk() / "tum" / "depth" / stamp).string(), cv::IMREAD_UNCHANGED);
    ASSERT_FALSE(color.empty() || depth.empty()) << stamp;
    put_matrix(bytes, pose.matrix());
    put(bytes, us);
    put(bytes, us);
    put(bytes, std::uint64_t{color.size()});
    put(bytes, std::uint64_t{depth.total() * depth.elemSize()});
    bytes += color;
    bytes.append(reinterpret_cast<const char*>(depth.data), depth.total() * depth.elemSize());
  }
  put(bytes, std::uint64_t{0});  // inertial samples
  write(data() / "scene0001_00" / "scene0001_00.sens", bytes);
  run(table("scannet"));
  expect_good_rows("scene0001_00");
}

TEST_F(SuiteRuns, Go2) {
  fs::create_directories(data() / "Seq1");
  for (const char* const file : {"metadata.yaml", "walk_0.db3", "groundtruth_base.txt"}) {
    fs::copy(walk() / file, data() / "Seq1" / file);
  }
  run(table("go2"));
  expect_good_rows("Seq1");
}

/// The lines of --list, run by a shell, and --collect make the table that the command itself makes.
TEST_F(SuiteRuns, SimulatedBitByBit) {
  fs::create_directories(data());
  fs::copy(walk(), data() / "office-1", fs::copy_options::recursive);
  auto command = table("sim");
  run(command);
  expect_good_rows("office-1");
  const std::string poses = content(output() / "office-1" / "r" / "final_camera.txt");
  fs::remove_all(output());
  command.emplace_back("--list");
  std::istringstream lines{run(command)};
  std::string line;
  std::size_t count = 0;
  while (std::getline(lines, line)) {
    run({"/bin/sh", "-c", line});
    ++count;
  }
  EXPECT_EQ(count, 2U);
  command.back() = "--collect";
  run(command);
  expect_good_rows("office-1");
  EXPECT_EQ(content(output() / "office-1" / "r" / "final_camera.txt"), poses);
}

}  // namespace
}  // namespace geoflow::tools
