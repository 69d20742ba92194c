#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace geoflow::tests {

/// `$GEOFLOW_DATA/name` if that exists: the folder of real recordings that some tests need.
[[nodiscard]] std::optional<std::filesystem::path> data_path(std::string_view name);

/// The seed of a random test: `$GEOFLOW_TEST_SEED`, or `fallback`. Print it in failure messages.
[[nodiscard]] std::uint64_t test_seed(std::uint64_t fallback);

/// A fresh directory under the system's temporary folder, removed with its content at the end of
/// scope.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  ~TemporaryDirectory();
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace geoflow::tests

/// Names the skipped test and what it lacks. Usage: `GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");`
#define GEOFLOW_DATA_OR_SKIP(variable, name)                                      \
  const auto variable##_found = ::geoflow::tests::data_path(name);                \
  if (!variable##_found) {                                                        \
    GTEST_SKIP() << "needs " << (name) << " in the folder named by GEOFLOW_DATA"; \
  }                                                                               \
  const std::filesystem::path& variable = *variable##_found
