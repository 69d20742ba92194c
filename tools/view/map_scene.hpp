#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

/// A saved map as a page draws it. A map is read when a page asks for it, once for all pages, and
/// on that page's thread: where nobody looks, nothing is read. Thread-safe.
class MapScene {
 public:
  /// Shows the file as it is from now on; what was read of it before is forgotten.
  void show(const std::filesystem::path& file);

  /// The map in the binary form of docs/view.md: keyframes, points, surfaces in cubes of 5 cm (of
  /// 10, 20 … where these are more than 100000), loops. Errors: kNotFound before show(), and as
  /// slam::load_map().
  [[nodiscard]] Result<std::shared_ptr<const std::string>> bytes();

 private:
  std::mutex reading_;  ///< held while a file is read: of two pages one reads
  std::mutex mutex_;    ///< of what follows; never held for long
  std::filesystem::path file_;
  std::uint64_t version_ = 0;  ///< counts calls of show()
  std::shared_ptr<const std::string> bytes_;
};

}  // namespace geoflow::tools
