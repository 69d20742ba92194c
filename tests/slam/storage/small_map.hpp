#pragma once

#include <filesystem>
#include <string>

#include "storage/stored_map.hpp"

namespace geoflow::slam::tests {

/// A map with one of everything: three keyframes of two threads, two points, an edge, a join,
/// places and depth. `name` stands in its identity, so that two of them differ.
[[nodiscard]] StoredMap small_map(const std::string& name);

[[nodiscard]] std::string read_bytes(const std::filesystem::path& path);
void write_bytes(const std::filesystem::path& path, const std::string& bytes);

}  // namespace geoflow::slam::tests
