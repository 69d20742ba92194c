#include "replay/line_file.hpp"

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/text.hpp"

namespace geoflow::drivers::text {

LineFile::LineFile(std::string path, std::ifstream file)
    : path_{std::move(path)}, file_{std::move(file)} {}

Result<LineFile> LineFile::open(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return fail(ErrorCode::kNotFound, "{}: no such file", path.string());
  }
  std::ifstream file{path, std::ios::binary};
  if (!file) {
    return fail(ErrorCode::kSystem, "{}: cannot be read", path.string());
  }
  return LineFile{path.string(), std::move(file)};
}

Result<std::optional<Line>> LineFile::next() {
  while (file_) {
    line_.resize(kLongestLine + 1);
    file_.getline(line_.data(), static_cast<std::streamsize>(line_.size()));
    const auto read = static_cast<std::size_t>(file_.gcount());
    if (read == 0) {
      break;
    }
    ++number_;
    if (file_.fail()) {  // the buffer is full and the line is not at its end
      file_.clear();
      file_.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
      return fail(ErrorCode::kInvalidData, "{}: a line of more than {} bytes", where(),
                  kLongestLine);
    }
    line_.resize(file_.eof() ? read : read - 1);
    auto data = data_of(line_);
    if (!data) {
      return tl::unexpected{std::move(data.error()).in(where())};
    }
    if (!data->empty()) {
      return Line{.number = number_, .text = *data};
    }
  }
  return std::nullopt;
}

std::string LineFile::where() const {
  return fmt::format("{}:{}", path_, number_);
}

}  // namespace geoflow::drivers::text
