#include "geoflow/tools/verb.hpp"

#include <memory>
#include <string>
#include <string_view>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/daemon_text.hpp"
#include "geoflow/tools/live_client.hpp"

namespace geoflow::tools {
namespace {

class StatusVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "status"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Say how the running daemon is";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow status                            tracking, sensors, map, clients in words\n"
           "  geoflow status --json | jq .health        for scripts; the keys: docs/protocol.md\n"
           "  geoflow status --socket /tmp/ctl.sock     of a daemon that listens elsewhere\n"
           "The exit code is 4 where no daemon answers.";
  }
  void declare(CLI::App& command) override { daemon_.declare(command); }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return daemon_.connect()
        .and_then([&] { return daemon_.status(); })
        .map([&](const nlohmann::json& status) {
          console.object(status);
          for (const std::string& line : daemon_lines(status)) {
            console.line("{}", line);
          }
          return ExitCode::kOk;
        });
  }

 private:
  LiveClient daemon_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_status_verb() {
  return std::make_unique<StatusVerb>();
}

}  // namespace geoflow::tools
