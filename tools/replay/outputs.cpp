#include "replay/outputs.hpp"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/output_files.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "replay/session.hpp"

namespace geoflow::tools {

namespace fs = std::filesystem;

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
  return replace_file(directory / "report.json", text);
}

}  // namespace geoflow::tools
