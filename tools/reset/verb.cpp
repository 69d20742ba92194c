#include "geoflow/tools/verb.hpp"

#include <memory>
#include <string_view>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/daemon_text.hpp"
#include "geoflow/tools/live_client.hpp"

namespace geoflow::tools {
namespace {

class ResetVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "reset"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Have the daemon's estimator begin anew, in the map as it is";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow reset                             odometry begins at the identity; the place "
           "is "
           "looked for in the map\n"
           "  geoflow map reset                         the same with an empty map\n"
           "For root, the daemon's user and members of the socket's group.";
  }
  void declare(CLI::App& command) override { daemon_.declare(command); }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return daemon_.ask_once({{"cmd", "reset"}}).map([&](const nlohmann::json& reply) {
      console.object({{"keyframes", reply.value("keyframes", nlohmann::json{})}});
      console.line("begun anew; the place is looked for in a map of {:.0f} keyframes",
                   number_at(reply, "keyframes"));
      return ExitCode::kOk;
    });
  }

 private:
  LiveClient daemon_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_reset_verb() {
  return std::make_unique<ResetVerb>();
}

}  // namespace geoflow::tools
