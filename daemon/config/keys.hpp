#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {

/// One key of the configuration: its dotted name, the member it sets and the values it takes. A
/// Duration is written in seconds and its range is in seconds; strings and paths have no range.
struct Key {
  using Target = std::variant<bool*, int*, std::uint64_t*, double*, Duration*, std::string*,
                              std::filesystem::path*>;
  std::string name;
  Target target;
  double minimum = 0;
  double maximum = 0;
};

/// Every key, bound to the members of `config`, which must outlive the result. The one list of what
/// can be configured.
[[nodiscard]] std::vector<Key> bind_keys(Config& config);

/// The known key that is most like `unknown` (edit distance), for messages.
[[nodiscard]] std::string nearest_key(const std::vector<Key>& keys, std::string_view unknown);

}  // namespace geoflow::daemon
