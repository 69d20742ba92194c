#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

/// What a program writes to its standard output, and the end of it where that is more than
/// `most_bytes`. kNotFound where there is no such program (looked for in $PATH), kSystem where it
/// ends with another code than 0. Its standard error goes nowhere.
[[nodiscard]] Result<std::string> output_of(const std::vector<std::string>& command,
                                            std::size_t most_bytes);

/// A folder that is to be packed; removed at the end of scope. Thread-bound.
class Staging {
 public:
  /// Makes it, below the folder for temporary files. `name` is the archive's one folder.
  [[nodiscard]] static Result<Staging> create(const std::string& name);
  Staging(Staging&& other) noexcept;
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;
  Staging& operator=(Staging&&) = delete;
  ~Staging();

  /// Adds a file of this text. kSystem, naming it.
  [[nodiscard]] Result<void> add(const std::string& name, const std::string& text) const;
  /// Adds a file or folder of the machine, below `attached/`. kNotFound, kSystem.
  [[nodiscard]] Result<void> attach(const std::filesystem::path& path) const;
  /// Packs all as a gzipped tar: `file` is whole or not there. kSystem.
  [[nodiscard]] Result<void> pack(const std::filesystem::path& file) const;

 private:
  Staging(std::filesystem::path root, std::string name);
  std::filesystem::path root_;  // empty: moved from
  std::string name_;
};

}  // namespace geoflow::tools
