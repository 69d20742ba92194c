#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace geoflow::tests {

/// The golden records of a protocol version (`1.1`), by name: hello, welcome, refuse, pose, end.
[[nodiscard]] std::map<std::string, std::vector<std::byte>> golden_records(
    const std::string& version);

}  // namespace geoflow::tests
