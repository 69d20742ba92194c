#pragma once

#include <string_view>

#include "geoflow/hal/result.hpp"

namespace geoflow {

/// Refuses text that toml++ 3.3 must not see: it asserts, where it should report, that a key
/// follows the bracket of a table's header and that what stands outside of strings and comments is
/// ASCII (and where assertions are off, the compiler may build on them). Everything else is left to
/// the parser's own errors. Every bracket outside of strings and comments is taken for a header's:
/// nothing of ours has arrays. Pure. Errors: kInvalidArgument, naming `name` and the line.
[[nodiscard]] Result<void> check_toml_text(std::string_view name, std::string_view text);

}  // namespace geoflow
