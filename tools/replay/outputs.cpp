#include "replay/outputs.hpp"

#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "replay/session.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;

/// Writes beside the target, then renames over it.
Result<void> replace_file(const fs::path& target,
                          const std::function<Result<void>(const fs::path&)>& write) {
  fs::path partial = target;
  partial += ".partial";
  auto written = write(partial);
  if (!written) {
    return written;
  }
  std::error_code code;
  fs::rename(partial, target, code);
  if (code) {
    return fail(ErrorCode::kSystem, "{}: {}", target.string(), code.message());
  }
  return {};
}

Result<void> write_text(const fs::path& path, std::string_view text) {
  std::ofstream out{path, std::ios::binary | std::ios::trunc};
  out.write(text.data(), static_cast<std::streamsize>(text.size()));
  out.close();
  return out ? Result<void>{} : fail(ErrorCode::kSystem, "{}: cannot be written", path.string());
}

}  // namespace

Result<void> prepare_output(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (code || !fs::is_directory(directory, code)) {
    return fail(ErrorCode::kSystem, "{}: cannot be made: {}", directory.string(),
                code ? code.message() : std::string{"it is a file"});
  }
  const fs::path probe = directory / ".probe";
  auto written = write_text(probe, "");
  fs::remove(probe, code);
  return written;
}

Result<void> write_outputs(const fs::path& directory, const ReplayResult& result,
                           const nlohmann::json& report) {
  const Calibration& calibration = result.run.streams->calibration();
  std::vector<std::pair<const char*, Trajectory>> files = {
      {"live_base.txt", result.live_base},
      {"live_camera.txt", camera_trajectory(result.live_base, calibration)},
      {"final_base.txt", result.final_base},
      {"final_camera.txt", camera_trajectory(result.final_base, calibration)}};
  if (!result.imu_base.empty()) {
    files.emplace_back("live_imu_base.txt", result.imu_base);
  }
  for (const auto& [name, trajectory] : files) {
    auto written = replace_file(directory / name, [&poses = trajectory](const fs::path& path) {
      return write_tum(path, poses);
    });
    if (!written) {
      return written;
    }
  }
  auto estimates = replace_file(directory / "estimates.csv", [&](const fs::path& path) {
    return write_estimates(path, result.estimates);
  });
  if (!estimates) {
    return estimates;
  }
  constexpr int kIndent = 2;
  const std::string text =
      report.dump(kIndent, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  return replace_file(directory / "report.json",
                      [&](const fs::path& path) { return write_text(path, text); });
}

}  // namespace geoflow::tools
