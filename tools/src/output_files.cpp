#include "geoflow/tools/output_files.hpp"

#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/core.h>

#include "geoflow/hal/result.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;

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

Result<void> replace_file(const fs::path& target,
                          const std::function<Result<void>(const fs::path&)>& write) {
  // The ending stays at the end: it may say what is to be written.
  const fs::path partial = target.parent_path() / fmt::format(".{}", target.filename().string());
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

Result<void> replace_file(const fs::path& target, std::string_view text) {
  return replace_file(target, [text](const fs::path& path) { return write_text(path, text); });
}

}  // namespace geoflow::tools
