#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace geoflow::tools {

/// What has grown between two status replies (docs/protocol.md), a second: `frames_hz`, `sources`
/// (name → samples), `stages` (name → runs), `drops` (name → dropped). Zero where the daemon has
/// begun anew between them. Pure.
[[nodiscard]] nlohmann::json rates(const nlohmann::json& before, const nlohmann::json& now);

/// The screen of `geoflow top` from a status reply and its rates. Pure.
[[nodiscard]] std::vector<std::string> top_lines(const nlohmann::json& status,
                                                 const nlohmann::json& rates);

}  // namespace geoflow::tools
