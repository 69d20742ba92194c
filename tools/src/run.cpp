#include "geoflow/tools/run.hpp"

#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Error.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/verb.hpp"

namespace geoflow::tools {
namespace {

constexpr std::string_view kDescription =
    "GeoFlow-SLAM for a legged robot with an RGB-D camera: replay recordings, watch poses, judge "
    "trajectories.";

/// One verb, the subcommand it was declared on, and its --json switch.
struct Entry {
  std::unique_ptr<Verb> verb;
  CLI::App* command = nullptr;
  bool json = false;
};

void declare(CLI::App& app, Entry& entry) {
  entry.command =
      app.add_subcommand(std::string{entry.verb->name()}, std::string{entry.verb->summary()});
  entry.command->add_flag("--json", entry.json, "Print JSON with documented keys instead of text");
  entry.command->footer("Examples:\n" + std::string{entry.verb->examples()});
  entry.verb->declare(*entry.command);
}

int report(const Error& error, Console& console, std::string_view verb) {
  console.end_progress();
  console.object({{"error", {{"code", error_name(error.code)}, {"message", error.message}}}});
  const std::string text = fmt::format("geoflow {}: {}\n", verb, error.message);
  std::fwrite(text.data(), 1, text.size(), stderr);
  return static_cast<int>(exit_code(error));
}

int run_verb(Entry& entry) {
  Console console{entry.json};
  Result<ExitCode> result;
  try {
    result = entry.verb->run(console);
  } catch (const std::exception& exception) {
    result = fail(ErrorCode::kSystem, "{}", exception.what());
  }
  console.end_progress();
  return result ? static_cast<int>(*result) : report(result.error(), console, entry.verb->name());
}

}  // namespace

int run_command(std::string_view version, std::vector<std::unique_ptr<Verb>> verbs, int argc,
                const char* const* argv) {
  CLI::App app{std::string{kDescription}, "geoflow"};
  app.require_subcommand(1);
  app.set_version_flag("--version", fmt::format("geoflow {}", version));
  app.footer("`geoflow VERB --help` shows a verb's options and examples. Exit codes: docs/cli.md.");
  std::vector<Entry> entries;
  entries.reserve(verbs.size());
  for (auto& verb : verbs) {
    declare(app, entries.emplace_back(Entry{.verb = std::move(verb)}));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? static_cast<int>(ExitCode::kOk)
                                : static_cast<int>(ExitCode::kUsage);
  }
  for (auto& entry : entries) {
    if (entry.command->parsed()) {
      return run_verb(entry);
    }
  }
  return static_cast<int>(ExitCode::kUsage);
}

}  // namespace geoflow::tools
