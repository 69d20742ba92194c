#pragma once

#include <string_view>

/// Files of this folder as part of the program (geoflow_embed).
namespace geoflow::tools {

[[nodiscard]] std::string_view view_page() noexcept;     ///< view.html
[[nodiscard]] std::string_view view_script() noexcept;   ///< view.js
[[nodiscard]] std::string_view scene_script() noexcept;  ///< scene.js

}  // namespace geoflow::tools
