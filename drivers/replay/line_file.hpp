#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>

#include "geoflow/hal/result.hpp"

#include "replay/text.hpp"

namespace geoflow::drivers::text {

/// A text file read line by line in bounded memory; the rules of for_each_line(). Thread-bound.
class LineFile {
 public:
  [[nodiscard]] static Result<LineFile> open(const std::filesystem::path& path);

  /// The next data line, valid until the next call; none at the end. After an Error, which names
  /// file and line, the next call goes on behind that line.
  [[nodiscard]] Result<std::optional<Line>> next();

  /// `file:line` of the line last returned.
  [[nodiscard]] std::string where() const;

 private:
  LineFile(std::string path, std::ifstream file);

  std::string path_;
  std::ifstream file_;
  std::string line_;
  std::size_t number_ = 0;
};

}  // namespace geoflow::drivers::text
