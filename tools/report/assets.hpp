#pragma once

#include <string_view>

/// Files of this folder as part of the program (geoflow_embed).
namespace geoflow::tools {

[[nodiscard]] std::string_view report_page() noexcept;    ///< report.html
[[nodiscard]] std::string_view report_script() noexcept;  ///< report.js

}  // namespace geoflow::tools
