#include "map/live.hpp"

#include <cstdint>
#include <string>

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
  daemon_.declare(*save_);
  reset_ = command.add_subcommand(
      "reset", "Have the running daemon begin with an empty map; its file is moved to FILE.old");
  daemon_.declare(*reset_);
}

Result<ExitCode> LiveMap::run(Console& console) {
  const bool saves = save_->parsed();
  return daemon_.ask_once({{"cmd", "map"}, {"do", saves ? "save" : "reset"}})
      .map([&](const json& reply) {
        if (saves) {
          console.object({{"saved", text_at(reply, "saved")},
                          {"keyframes", reply.value("keyframes", json{})},
                          {"bytes", reply.value("bytes", json{})}});
          console.line("saved: {}, {:.0f} keyframes, {}", text_at(reply, "saved"),
                       number_at(reply, "keyframes"),
                       bytes_in_words(static_cast<std::uint64_t>(number_at(reply, "bytes"))));
        } else {
          const std::string moved = text_at(reply, "moved");
          console.object({{"moved", moved}});
          console.line("begun with an empty map{}{}",
                       moved.empty() ? "" : "; the former one: ", moved);
        }
        return ExitCode::kOk;
      });
}

}  // namespace geoflow::tools
