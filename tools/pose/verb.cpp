#include "geoflow/tools/verb.hpp"

#include <chrono>
#include <cstdint>
#include <fstream>
#include <ios>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/pose_text.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

using daemon::PoseClient;
using daemon::ReceivedPose;

constexpr auto kWaitSlice = std::chrono::milliseconds{200};
constexpr double kHighestRateHz = 1000;
constexpr double kCameraRateHz = 30;  // a D435i's: who asks for more wants the IMU's poses

constexpr std::string_view kExamples =
    "  geoflow pose                              every pose, one a line, until the daemon "
    "ends or Ctrl-C\n"
    "  geoflow pose --once --json                the newest pose as one JSON object\n"
    "  geoflow pose --rate 2                     two a second\n"
    "  geoflow pose --rate 200                   carried on to each IMU sample\n"
    "  geoflow pose --json | jq .p_odom_base     for scripts\n"
    "  geoflow pose --tum live.txt               the poses in the map to a file, for "
    "geoflow "
    "evaluate\n"
    "Any number of them may run at once. The keys of the JSON: docs/protocol.md.";

class PoseVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "pose"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Show the live pose from the daemon's socket";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }

  void declare(CLI::App& command) override {
    command.add_option("--socket", socket_, "The daemon's pose socket")->capture_default_str();
    command
        .add_option("--rate", rate_hz_,
                    "Poses a second at most; 0: every frame's. Above 30, poses at IMU samples, "
                    "carried on from the newest frame by IMU and legs")
        ->check(CLI::Range(0.0, kHighestRateHz))
        ->capture_default_str();
    command.add_option("--count", count_, "End after so many poses; 0: do not");
    command.add_flag("--once", once_, "End after one pose");
    command.add_option("--tum", tum_,
                       "Also write base_link in the map to this file as TUM text, at the times of "
                       "the recording");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    auto client = PoseClient::connect(
        socket_,
        {.name = "geoflow pose", .max_rate_hz = rate_hz_, .propagated = rate_hz_ > kCameraRateHz});
    if (!client) {
      return tl::unexpected{std::move(client.error())};
    }
    std::ofstream trajectory;
    if (!tum_.empty()) {
      trajectory.open(tum_, std::ios::binary | std::ios::trunc);
    }
    auto code = follow(*client, console, trajectory);
    if (!tum_.empty() && !trajectory.flush()) {
      return fail(ErrorCode::kSystem, "{}: cannot be written", tum_);
    }
    return code;
  }

 private:
  [[nodiscard]] Result<ExitCode> follow(PoseClient& client, Console& console,
                                        std::ofstream& trajectory) const {
    const InterruptScope interrupt;
    const std::uint64_t wanted = once_ ? 1 : count_;
    std::uint64_t shown = 0;
    while (!InterruptScope::requested()) {
      auto received = client.receive(kWaitSlice);
      if (!received) {
        return tl::unexpected{std::move(received.error())};
      }
      if (const auto* ended = std::get_if<PoseClient::Ended>(&*received)) {
        return end(*ended, shown);
      }
      if (const auto* pose = std::get_if<ReceivedPose>(&*received)) {
        show(*pose, console);
        if (daemon::has_pose(static_cast<TrackingStatus>(pose->pose.status))) {
          trajectory << format_tum_line({.t = HostTime{Duration{pose->pose.t_recording_ns}},
                                         .pose = map_from_base(pose->pose)})
                     << '\n';
        }
        if (++shown == wanted) {
          break;
        }
      }
    }
    return ExitCode::kOk;
  }

  [[nodiscard]] static Result<ExitCode> end(const PoseClient::Ended& ended, std::uint64_t shown) {
    if (ended.reason == 0 || shown == 0) {
      return fail(ErrorCode::kUnavailable, "the daemon {}",
                  ended.reason == 0 ? "has gone" : "ended before any pose");
    }
    return ExitCode::kOk;
  }

  static void show(const ReceivedPose& received, Console& console) {
    if (console.json()) {
      console.object(pose_object(received));
    } else {
      console.line("{}", pose_line(received));
    }
  }

  std::string socket_ = daemon::SocketConfig{}.pose.string();
  double rate_hz_ = 0;
  std::uint64_t count_ = 0;
  bool once_ = false;
  std::string tum_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_pose_verb() {
  return std::make_unique<PoseVerb>();
}

}  // namespace geoflow::tools
