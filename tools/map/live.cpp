#include "map/live.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/daemon_text.hpp"
#include "geoflow/tools/live_client.hpp"

namespace geoflow::tools {

using nlohmann::json;

void LiveMap::declare(CLI::App& command) {
  save_ = command.add_subcommand("save", "Have the running daemon write its map to its file now");
  load_ = command.add_subcommand(
      "load", "Have the running daemon take another file's map; its own is kept as FILE.old");
  load_->add_option("map", file_, "Map file, which the daemon must be able to read")->required();
  reset_ = command.add_subcommand(
      "reset", "Have the running daemon begin with an empty map; its file is moved to FILE.old");
  for (CLI::App* subcommand : {save_, load_, reset_}) {
    daemon_.declare(*subcommand);
  }
}

Result<ExitCode> LiveMap::run(Console& console) {
  const auto done = save_->parsed()   ? save(console)
                    : load_->parsed() ? load(console)
                                      : reset(console);
  return done.map([] { return ExitCode::kOk; });
}

Result<void> LiveMap::save(Console& console) {
  return daemon_.ask_once({{"cmd", "map"}, {"do", "save"}}).map([&](const json& reply) {
    console.object({{"saved", text_at(reply, "saved")},
                    {"keyframes", reply.value("keyframes", json{})},
                    {"bytes", reply.value("bytes", json{})}});
    console.line("saved: {}, {:.0f} keyframes, {}", text_at(reply, "saved"),
                 number_at(reply, "keyframes"),
                 bytes_in_words(static_cast<std::uint64_t>(number_at(reply, "bytes"))));
  });
}

Result<void> LiveMap::load(Console& console) {
  std::error_code unknown;  // of this process's folder; the daemon's is another one
  const auto file = std::filesystem::absolute(file_, unknown);
  return daemon_.ask_once({{"cmd", "map"}, {"do", "load"}, {"file", file.string()}})
      .map([&](const json& reply) {
        console.object({{"loaded", text_at(reply, "loaded")},
                        {"moved", text_at(reply, "moved")},
                        {"keyframes", reply.value("keyframes", json{})}});
        console.line("loaded: {}, {:.0f} keyframes; the former map: {}", text_at(reply, "loaded"),
                     number_at(reply, "keyframes"), text_at(reply, "moved"));
      });
}

Result<void> LiveMap::reset(Console& console) {
  return daemon_.ask_once({{"cmd", "map"}, {"do", "reset"}}).map([&](const json& reply) {
    const std::string moved = text_at(reply, "moved");
    console.object({{"moved", moved}});
    console.line("begun with an empty map{}{}", moved.empty() ? "" : "; the former one: ", moved);
  });
}

}  // namespace geoflow::tools
