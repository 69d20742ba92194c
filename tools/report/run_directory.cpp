#include "report/run_directory.hpp"

#include <array>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::string_view kReport = "report.json";
constexpr std::string_view kEstimates = "estimates.csv";

constexpr std::array<std::string_view, 5> kSections{"input", "by_status", "drops", "times_ms",
                                                    "configuration"};
constexpr std::array<std::string_view, 5> kTimes{"count", "mean", "p50", "p99", "max"};

bool has_number(const json& object, std::string_view key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number();
}

/// What is missing of the keys that a page is made from; empty: nothing.
std::string key_problem(const json& report) {
  if (!report.is_object()) {
    return "is no JSON object";
  }
  for (const std::string_view key : {"frames", "tracked"}) {
    if (!has_number(report, key)) {
      return fmt::format("the key \"{}\" should be a number", key);
    }
  }
  for (const std::string_view key : kSections) {
    if (!report.contains(key) || !report.at(std::string{key}).is_object()) {
      return fmt::format("the key \"{}\" should be an object", key);
    }
  }
  const auto path = report.at("input").find("path");
  if (path == report.at("input").end() || !path->is_string()) {
    return R"(the key "input"."path" should be a text)";
  }
  for (const auto& [stage, times] : report.at("times_ms").items()) {
    for (const std::string_view key : kTimes) {
      if (!times.is_object() || !has_number(times, key)) {
        return fmt::format(R"(the key "times_ms"."{}"."{}" should be a number)", stage, key);
      }
    }
  }
  return {};
}

Result<json> read_report(const fs::path& file) {
  auto report = read_json(file);
  if (report) {
    if (const std::string problem = key_problem(*report); !problem.empty()) {
      return fail(ErrorCode::kInvalidData, "{}: {}", file.string(), problem);
    }
  }
  return report;
}

}  // namespace

fs::path RunDirectory::recording() const {
  return report.at("input").at("path").get<std::string>();
}

SE3 RunDirectory::T_base_cam() const {
  const SE3 T_map_base = live_base.poses.front().pose;
  const SE3 T_map_cam = live_camera.poses.front().pose;
  return T_map_base.inverse() * T_map_cam;
}

bool is_run_directory(const fs::path& path) {
  std::error_code error;
  return fs::exists(path / kReport, error) && fs::exists(path / kEstimates, error);
}

Result<json> read_json(const fs::path& file) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream) {
    return fail_errno(file.string());
  }
  try {
    return json::parse(stream);
  } catch (const json::exception& error) {
    return fail(ErrorCode::kInvalidData, "{}: {}", file.string(), error.what());
  }
}

Result<RunDirectory> read_run(const fs::path& path) {
  RunDirectory run{.path = path};
  auto report = read_report(path / kReport);
  if (!report) {
    return tl::unexpected{std::move(report.error())};
  }
  run.report = *std::move(report);
  auto estimates = read_estimates(path / kEstimates);
  if (!estimates) {
    return tl::unexpected{std::move(estimates.error())};
  }
  run.estimates = *std::move(estimates);
  for (const auto& [name, file] : {std::pair{"live_base.txt", &run.live_base},
                                   {"live_camera.txt", &run.live_camera},
                                   {"final_base.txt", &run.final_base},
                                   {"final_camera.txt", &run.final_camera}}) {
    auto trajectory = read_trajectory(path / name, TrajectoryFormat::kTum);
    if (!trajectory) {
      return tl::unexpected{std::move(trajectory.error())};
    }
    *file = *std::move(trajectory);
  }
  return run;
}

}  // namespace geoflow::tools
