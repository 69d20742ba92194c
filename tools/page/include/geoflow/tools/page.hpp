#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

/// Web pages that need nothing from outside: text and scripts are part of the program. Pure;
/// thread-safe.
namespace geoflow::tools {

/// What is put in the places `{{name}}` of a template.
using PageParts = std::vector<std::pair<std::string_view, std::string_view>>;

/// The template with each `{{name}}` that `parts` names replaced by its text, in which nothing is
/// replaced again. A precondition: a part's text fits where the template has it.
[[nodiscard]] std::string fill_page(std::string_view page, const PageParts& parts);

/// JSON as it may stand inside a `<script>` element: no `<` in it, so that no text from outside
/// ends the element or begins a comment. What is not UTF-8 becomes U+FFFD.
[[nodiscard]] std::string json_for_page(const nlohmann::json& value);

/// Styles that all pages share: light and dark, from a phone's width on.
[[nodiscard]] std::string_view page_styles() noexcept;
/// The script that draws Axes as to_json(const Figure&) writes them: `Plot.add(parent, axes,
/// colors)`.
[[nodiscard]] std::string_view plot_script() noexcept;

}  // namespace geoflow::tools
