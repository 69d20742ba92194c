#include "tests/support/data.hpp"

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

namespace geoflow::tests {

std::optional<std::filesystem::path> data_path(std::string_view name) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): never set here
  const char* root = std::getenv("GEOFLOW_DATA");
  if (root == nullptr) {
    return std::nullopt;
  }
  std::filesystem::path path = std::filesystem::path{root} / name;
  if (!std::filesystem::exists(path)) {
    return std::nullopt;
  }
  return path;
}

std::uint64_t test_seed(std::uint64_t fallback) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): never set here
  const char* seed = std::getenv("GEOFLOW_TEST_SEED");
  return seed == nullptr ? fallback : std::stoull(seed);
}

TemporaryDirectory::TemporaryDirectory() {
  std::string pattern = (std::filesystem::temp_directory_path() / "geoflow-test-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) {
    throw std::runtime_error{"no temporary directory: " + pattern};
  }
  path_ = pattern;
}

TemporaryDirectory::~TemporaryDirectory() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace geoflow::tests
