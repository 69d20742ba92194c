#include "geoflow/tools/trajectory_file.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <optional>
#include <string>

#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

const char* to_string(TrajectoryFormat format) noexcept {
  switch (format) {
    case TrajectoryFormat::kTum:
      return "tum";
    case TrajectoryFormat::kKitti:
      return "kitti";
    case TrajectoryFormat::kEuroc:
      return "euroc";
  }
  return "unknown";
}

Result<TrajectoryFile> read_trajectory(const std::filesystem::path& path,
                                       std::optional<TrajectoryFormat> format) {
  constexpr std::size_t kChunkBytes = std::size_t{1} << 16U;
  std::ifstream stream{path, std::ios::binary};
  if (!stream) {
    return fail_errno(path.string());
  }
  std::string text;
  std::array<char, kChunkBytes> chunk{};
  while (stream) {
    stream.read(chunk.data(), chunk.size());
    text.append(chunk.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kMaxTrajectoryFileBytes) {
      return fail(ErrorCode::kUnsupported,
                  "{}: larger than {} bytes, which no trajectory should be", path.string(),
                  kMaxTrajectoryFileBytes);
    }
  }
  if (stream.bad()) {
    return fail_errno(path.string());
  }
  return parse_trajectory(text, path.string(), format);
}

}  // namespace geoflow::tools
