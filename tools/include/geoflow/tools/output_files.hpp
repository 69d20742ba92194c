#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "geoflow/hal/result.hpp"

/// A verb's output files, each there as a whole or not at all. Errors are kSystem and name the
/// path.
namespace geoflow::tools {

/// Makes the output folder if it is not there, and checks that files can be written to it, before
/// any work is done.
[[nodiscard]] Result<void> prepare_output(const std::filesystem::path& directory);

/// Has `write` write beside the target, under the name that it is given, then renames that over the
/// target.
[[nodiscard]] Result<void> replace_file(
    const std::filesystem::path& target,
    const std::function<Result<void>(const std::filesystem::path&)>& write);

/// The same with a text.
[[nodiscard]] Result<void> replace_file(const std::filesystem::path& target, std::string_view text);

}  // namespace geoflow::tools
