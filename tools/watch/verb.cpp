#include "geoflow/tools/verb.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/daemon_text.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/live_client.hpp"
#include "geoflow/tools/pose_text.hpp"

namespace geoflow::tools {
namespace {

using daemon::PoseClient;
using daemon::ReceivedPose;

constexpr auto kWaitSlice = std::chrono::milliseconds{200};
constexpr auto kStatusPeriod = std::chrono::seconds{1};
constexpr double kDefaultRateHz = 2;
constexpr double kHighestRateHz = 1000;

class WatchVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "watch"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Show poses as they come and, between them, what changes of the daemon's state";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow watch                             two poses a second, and each change of "
           "state\n"
           "  geoflow watch --rate 0                    every frame's pose\n"
           "  geoflow watch --status                    only the changes of state\n"
           "  geoflow watch --json | jq -c .stream      for scripts: \"pose\" or \"status\"\n"
           "Until the daemon ends or Ctrl-C.";
  }

  void declare(CLI::App& command) override {
    daemon_.declare(command);
    command.add_option("--pose-socket", pose_socket_, "The daemon's pose socket")
        ->capture_default_str();
    command.add_option("--rate", rate_hz_, "Poses a second at most; 0: every frame's")
        ->check(CLI::Range(0.0, kHighestRateHz))
        ->capture_default_str();
    command.add_flag("--status", only_status_, "No poses");
    command.add_option("--count", count_,
                       "End after so many poses (with --status: changes); 0: do not");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return daemon_.connect().and_then([&]() -> Result<ExitCode> {
      auto poses =
          PoseClient::connect(pose_socket_, {.name = "geoflow watch", .max_rate_hz = rate_hz_});
      if (!poses) {
        return tl::unexpected{std::move(poses.error())};
      }
      return follow(*poses, console);
    });
  }

 private:
  [[nodiscard]] Result<ExitCode> follow(PoseClient& poses, Console& console) {
    const InterruptScope interrupt;
    std::uint64_t shown = 0;
    std::optional<HostTime> asked;
    while (!InterruptScope::requested() && (count_ == 0 || shown < count_)) {
      if (const HostTime now = HostClock::now(); !asked || now - *asked >= kStatusPeriod) {
        asked = now;
        const auto changed = show_state(console);
        if (!changed) {
          return tl::unexpected{changed.error()};
        }
        shown += only_status_ && *changed ? 1U : 0U;
      }
      const auto received = poses.receive(kWaitSlice);
      if (!received) {
        return tl::unexpected{received.error()};
      }
      if (const auto* ended = std::get_if<PoseClient::Ended>(&*received)) {
        return at_end(*ended);
      }
      if (const auto* pose = std::get_if<ReceivedPose>(&*received);
          pose != nullptr && !only_status_) {
        show(*pose, console);
        ++shown;
      }
    }
    return ExitCode::kOk;
  }

  [[nodiscard]] static Result<ExitCode> at_end(const PoseClient::Ended& ended) {
    if (ended.reason == 0) {
      return fail(ErrorCode::kUnavailable, "the daemon has gone");
    }
    return ExitCode::kOk;
  }

  static void show(const ReceivedPose& received, Console& console) {
    if (console.json()) {
      nlohmann::json line = pose_object(received);
      line["stream"] = "pose";
      console.object(line);
    } else {
      console.line("{}", pose_line(received));
    }
  }

  /// Shows the daemon's state where it has changed; whether it has.
  [[nodiscard]] Result<bool> show_state(Console& console) {
    return daemon_.status().map([&](const nlohmann::json& status) {
      // What grows all the time is no change: the rate and the time in the state.
      const std::string state = text_at(status, "pose.status") + state_of_sources(status);
      if (std::exchange(state_, state) == state) {
        return false;
      }
      console.object({{"stream", "status"},
                      {"summary", text_at(status, "summary")},
                      {"status", text_at(status, "pose.status")},
                      {"health", status.value("health", nlohmann::json::object())},
                      {"trouble", text_at(status, "source.trouble")}});
      console.line("-- {}", text_at(status, "summary"));
      return true;
    });
  }

  [[nodiscard]] static std::string state_of_sources(const nlohmann::json& status) {
    std::string text = text_at(status, "source.trouble") + text_at(status, "map.trouble");
    const nlohmann::json sources = status.value("health", nlohmann::json::object());
    for (const auto& [name, health] : sources.items()) {
      text += "|" + name + text_at(health, "state") + text_at(health, "reason");
    }
    return text;
  }

  LiveClient daemon_;
  std::string pose_socket_ = daemon::SocketConfig{}.pose.string();
  double rate_hz_ = kDefaultRateHz;
  bool only_status_ = false;
  std::uint64_t count_ = 0;
  std::optional<std::string> state_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_watch_verb() {
  return std::make_unique<WatchVerb>();
}

}  // namespace geoflow::tools
