#pragma once

#include <span>
#include <string_view>

namespace geoflow {

/// The name with the smallest edit distance to `unknown` (the first of equals), for error messages;
/// empty for no names. Only the first 128 bytes of `unknown` are compared, so that its length does
/// not decide the work. Pure.
[[nodiscard]] std::string_view nearest_name(std::span<const std::string_view> names,
                                            std::string_view unknown);

}  // namespace geoflow
