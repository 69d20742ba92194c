#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

/// YAML values checked one by one, with errors that name file, line and key. Nothing here throws.
namespace geoflow::drivers::yaml {

/// A value and where it stands.
struct Entry {
  std::string file;
  std::string key;  ///< from the top: `cam0.intrinsics`; empty for the whole file
  YAML::Node node;

  /// An Error that begins `file:line: key: `.
  [[nodiscard]] Error error(std::string_view what) const;
};

/// Parses a file of at most 1 MiB. OpenCV's `%YAML:1.0` first line is understood.
[[nodiscard]] Result<Entry> load(const std::filesystem::path& path);
/// Parses text; `name` stands for the file in errors.
[[nodiscard]] Result<Entry> parse(std::string_view name, std::string content);

/// Calls `use` for every key of a map, in the file's order. Not a map, a key that is no text or
/// stands twice: an Error.
[[nodiscard]] Result<void> for_each(
    const Entry& map, const std::function<Result<void>(const Entry&, std::string_view key)>& use);

[[nodiscard]] Result<std::string> text(const Entry& entry);
[[nodiscard]] Result<double> number(const Entry& entry);  ///< finite
[[nodiscard]] Result<double> positive(const Entry& entry);
/// A sequence of numbers whose length is one of `sizes`.
[[nodiscard]] Result<std::vector<double>> numbers(const Entry& entry,
                                                  std::span<const std::size_t> sizes);
/// Four rows of four numbers that are a rigid transform: rows orthonormal to 1e-3, right-handed,
/// last row 0 0 0 1.
[[nodiscard]] Result<SE3> transform(const Entry& entry);
/// The same from 16 numbers, row by row.
[[nodiscard]] Result<SE3> transform_of_rows(const Entry& entry, std::span<const double> values);

}  // namespace geoflow::drivers::yaml
