#include "emulate/legs_command.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"

#include "emulate/leg_sources.hpp"

namespace geoflow::tools {
namespace {

constexpr double kShortestS = 0.1;
constexpr double kLongestS = 7200;
constexpr int kLargestDomain = 230;  // DDSI-RTPS 9.6.1.1: ports would not fit above 232
constexpr Duration kFirstDeviceTime = std::chrono::seconds{1};

}  // namespace

std::string_view LegsCommand::examples() noexcept {
  return "  geoflow emulate legs --can vcan0                      a simulated Go2 that walks, on "
         "CAN\n"
         "  geoflow emulate legs --can vcan0 --fd                 the same in CAN FD frames\n"
         "  geoflow emulate legs --dds lo --recording bag --loop  a recording's legs as a Go2 "
         "sends "
         "them\n"
         "  geoflowd --set source.legs=can --set can.interfaces=vcan0 --replay bag   who hears "
         "them";
}

void LegsCommand::declare(CLI::App& command) {
  CLI::Option* const can = command.add_option("--can", can_, "CAN interface to send on");
  command.add_option("--dictionary", dictionary_, "DBC file (default: the program's own)")
      ->needs(can);
  command.add_flag("--fd", fd_, "Send the dictionary's CAN FD frames")->needs(can);
  CLI::Option* const dds =
      command.add_option("--dds", dds_, "Network interface to send rt/lowstate on")->excludes(can);
  command.add_option("--domain", domain_, "DDS domain")
      ->needs(dds)
      ->check(CLI::Range(0, kLargestDomain).description(""))
      ->capture_default_str();
  CLI::Option* const recording =
      command.add_option("--recording", recording_, "Recording whose legs are sent");
  command
      .add_option(
          "--shift", shift_ns_,
          "CLOCK_MONOTONIC less the recording's time [ns], as `emulate d435i` says it: what "
          "is over by then is left out (default: the recording begins now)")
      ->needs(recording);
  command.add_flag("--simulate", simulate_, "Send a simulated walk (the default)")
      ->excludes(recording);
  command.add_option("--seed", simulated_.seed, "Decides the simulated walk")
      ->excludes(recording)
      ->capture_default_str();
  command.add_option("--duration", simulated_.duration_s, "Length of the simulated walk [s]")
      ->excludes(recording)
      ->check(CLI::Range(kShortestS, kLongestS).description(""))
      ->capture_default_str();
  command.add_flag("--loop", loop_, "Begin again at the end");
}

Result<std::unique_ptr<drivers::LegEmitter>> LegsCommand::open() const {
  if (!can_.empty()) {
    return drivers::open_can_emitter({.interface = can_, .dictionary = dictionary_, .fd = fd_});
  }
  if (!dds_.empty()) {
    return drivers::open_dds_emitter({.interface = dds_, .domain = domain_});
  }
  return fail(ErrorCode::kInvalidArgument, "--can INTERFACE or --dds INTERFACE is needed");
}

std::optional<Duration> LegsCommand::shift() const {
  return shift_ns_ ? std::optional{Duration{*shift_ns_}} : std::nullopt;
}

Result<ExitCode> LegsCommand::run(Console& console) const {
  auto emitter = open();
  if (!emitter) {
    return tl::unexpected{std::move(emitter.error())};
  }
  const InterruptScope interrupt;
  const HostTime begin = HostClock::now();
  std::uint64_t sent = 0;
  Duration last{};
  std::optional<Error> failure;
  const SampleHandler handler = [&](const drivers::EmittedSample& sample) {
    if (auto emitted = (*emitter)->emit(sample); !emitted) {
      failure = std::move(emitted.error());
    } else {
      ++sent;
      last = sample.device_time;
    }
    return !failure && !InterruptScope::requested();
  };
  console.line("sending; Ctrl-C ends it");
  Result<void> played;
  Duration offset = kFirstDeviceTime;
  do {
    played = recording_.empty() ? play_simulated_legs(simulated_, offset, handler)
                                : play_recorded_legs(recording_, shift(), offset, handler);
    offset = last + std::chrono::milliseconds{2};
  } while (played && loop_ && !failure && !InterruptScope::requested());
  if (!played || failure) {
    return tl::unexpected{played ? *failure : played.error()};
  }
  const double seconds = to_seconds(HostClock::now() - begin);
  console.line("{} samples in {:.1f} s", sent, seconds);
  console.object({{"samples", sent}, {"seconds", seconds}});
  return InterruptScope::requested() ? ExitCode::kInterrupted : ExitCode::kOk;
}

}  // namespace geoflow::tools
