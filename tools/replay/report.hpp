#pragma once

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/config.hpp"

#include "replay/session.hpp"

namespace geoflow::tools {

/// report.json; its keys are documented in docs/cli.md.
[[nodiscard]] nlohmann::json make_report(const ReplayResult& result, const daemon::Config& config);

}  // namespace geoflow::tools
