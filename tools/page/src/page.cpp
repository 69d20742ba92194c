#include "geoflow/tools/page.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace geoflow::tools {
namespace {

constexpr std::string_view kOpen = "{{";
constexpr std::string_view kClose = "}}";

}  // namespace

std::string fill_page(std::string_view page, const PageParts& parts) {
  std::string filled;
  while (true) {
    const std::size_t open = page.find(kOpen);
    const std::size_t close = page.find(kClose, open);
    if (close == std::string_view::npos) {
      filled += page;
      return filled;
    }
    filled += page.substr(0, open);
    const std::string_view name = page.substr(open + kOpen.size(), close - open - kOpen.size());
    const auto part = std::ranges::find(parts, name, &PageParts::value_type::first);
    filled += part != parts.end() ? part->second : page.substr(open, close + kClose.size() - open);
    page.remove_prefix(close + kClose.size());
  }
}

std::string json_for_page(const nlohmann::json& value) {
  const std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

}  // namespace geoflow::tools
