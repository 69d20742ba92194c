#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "geoflow/tools/verb.hpp"

namespace geoflow::tools {

/// Parses a command line, runs the verb it names and returns the process's exit code. Prints help,
/// usage errors and the verb's error (on standard error, and under `--json` as
/// `{"error":{"code":…,"message":…}}` on standard output). No exception leaves it.
[[nodiscard]] int run_command(std::string_view version, std::vector<std::unique_ptr<Verb>> verbs,
                              int argc, const char* const* argv);

}  // namespace geoflow::tools
