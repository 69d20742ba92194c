#pragma once

#include <span>
#include <string>

#include "calibrate/outcome.hpp"

namespace geoflow::tools {

/// A page about an outcome, with the figures' files by name beside it. Pure.
[[nodiscard]] std::string to_html(const Outcome& outcome, const std::string& date,
                                  std::span<const std::string> figure_files);

}  // namespace geoflow::tools
