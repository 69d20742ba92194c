#include "map/list.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/daemon_text.hpp"

namespace geoflow::tools {
namespace {

constexpr std::string_view kFirstBytes = "GFLOWMAP";  // docs/map-file.md

bool looks_like_map(const std::filesystem::path& file) {
  std::array<char, kFirstBytes.size()> bytes{};
  std::ifstream stream{file, std::ios::binary};
  stream.read(bytes.data(), bytes.size());
  return stream && std::string_view{bytes.data(), bytes.size()} == kFirstBytes;
}

/// Files that begin as maps do, by name.
Result<std::vector<std::filesystem::path>> maps_in(const std::string& folder) {
  std::vector<std::filesystem::path> maps;
  std::error_code failure;
  std::filesystem::directory_iterator entry{folder, failure};
  for (; !failure && entry != std::filesystem::directory_iterator{}; entry.increment(failure)) {
    std::error_code unknown;
    if (entry->is_regular_file(unknown) && looks_like_map(entry->path())) {
      maps.push_back(entry->path());
    }
  }
  if (failure) {
    return fail(
        failure == std::errc::no_such_file_or_directory ? ErrorCode::kNotFound : ErrorCode::kSystem,
        "{}: {}", folder, failure.message());
  }
  std::ranges::sort(maps);
  return maps;
}

double age_s(const std::filesystem::path& file) {
  std::error_code unknown;
  const auto written = std::filesystem::last_write_time(file, unknown);
  const auto age = std::filesystem::file_time_type::clock::now() - written;
  return unknown ? 0 : std::max(std::chrono::duration<double>{age}.count(), 0.0);
}

}  // namespace

void MapList::declare(CLI::App& command) {
  command_ = command.add_subcommand("ls", "The maps in a folder");
  command_->add_option("folder", folder_, "Folder")->capture_default_str();
}

Result<ExitCode> MapList::run(Console& console) const {
  return maps_in(folder_).map([&](const std::vector<std::filesystem::path>& maps) {
    for (const std::filesystem::path& file : maps) {
      std::error_code unknown;
      const std::uintmax_t bytes = std::filesystem::file_size(file, unknown);
      const auto map = slam::load_map(file);
      if (!map) {
        console.object({{"path", file.string()}, {"damaged", map.error().message}});
        console.line("{}: {}", file.string(), map.error().message);
        continue;
      }
      const slam::MapSummary summary = slam::summary(**map);
      console.object({{"path", file.string()},
                      {"bytes", bytes},
                      {"age_s", age_s(file)},
                      {"keyframes", summary.keyframes},
                      {"parts", summary.parts},
                      {"serial", summary.calibration.serial},
                      {"made_by", summary.made_by}});
      console.line("{}: {} keyframes, {}, written {} ago, camera {}", file.string(),
                   summary.keyframes, bytes_in_words(bytes),
                   daemon::in_words(from_seconds(age_s(file))),
                   summary.calibration.serial.empty() ? "unknown" : summary.calibration.serial);
    }
    if (maps.empty()) {
      console.line("{}: no maps", folder_);
    }
    return ExitCode::kOk;
  });
}

}  // namespace geoflow::tools
