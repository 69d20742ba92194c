#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "cloud/depth_cloud.hpp"

namespace geoflow::slam {

/// A keyframe's depth that lies in a file until it is needed. Immutable; thread-safe.
class StoredCloud {
 public:
  StoredCloud() = default;
  StoredCloud(const StoredCloud&) = delete;
  StoredCloud& operator=(const StoredCloud&) = delete;
  virtual ~StoredCloud() = default;

  /// Errors name file and byte.
  [[nodiscard]] virtual Result<std::shared_ptr<const DepthCloud>> read() const = 0;
  /// As it lies in the file, checksum tested. Errors as of read().
  [[nodiscard]] virtual Result<std::vector<std::byte>> bytes() const = 0;
};

}  // namespace geoflow::slam
