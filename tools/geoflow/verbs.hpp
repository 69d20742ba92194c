#pragma once

#include <memory>
#include <vector>

#include "geoflow/tools/verb.hpp"

namespace geoflow::tools {

/// Every verb of the `geoflow` command, in the order of its help. The list is made by CMake from
/// the folders of tools/.
[[nodiscard]] std::vector<std::unique_ptr<Verb>> make_verbs();

}  // namespace geoflow::tools
