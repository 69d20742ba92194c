#include "service/source_watch.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr Duration kSilence = std::chrono::milliseconds{1500};

const char* name_of(SourceState state) {
  switch (state) {
    case SourceState::kStopped:
      return "stopped";
    case SourceState::kStreaming:
      return "streaming";
    case SourceState::kDegraded:
      return "degraded";
    case SourceState::kFailed:
      return "failed";
  }
  return "unknown";
}

}  // namespace

const SourceWatch::Count& SourceWatch::count(const SourceReport& source, HostTime now) {
  const std::uint64_t delivered = source.health.delivered;
  auto known = std::ranges::find(counts_, source.name, &Count::name);
  if (known == counts_.end()) {
    return counts_.emplace_back(
        Count{.name = source.name, .delivered = delivered, .grew = now, .ever = delivered > 0});
  }
  // A source that begins anew counts anew.
  known->ever = known->ever || delivered > 0;
  if (known->delivered != delivered) {
    known->delivered = delivered;
    known->grew = now;
  }
  return *known;
}

std::string describe(const WatchedSource& source) {
  const SourceHealth& health = source.health;
  const std::string name = source.name == "imu" ? "IMU" : source.name;
  const std::string reason = health.reason.empty() ? "" : fmt::format(" ({})", health.reason);
  if (source.silent) {
    return fmt::format("{} silent {}{}", name, in_words(*source.silent), reason);
  }
  switch (health.state) {
    case SourceState::kDegraded:
      return fmt::format("{} degraded{}", name, reason);
    case SourceState::kFailed:
      return fmt::format("{} failed{}", name, reason);
    case SourceState::kStopped:
    case SourceState::kStreaming:
      break;
  }
  return name + " ok";
}

std::string state_name(const WatchedSource& source) {
  return source.silent ? "silent" : name_of(source.health.state);
}

void SourceWatch::look(const std::vector<SourceReport>& sources, HostTime now) {
  sources_.clear();
  for (const SourceReport& source : sources) {
    const Count& known = count(source, now);
    const Duration age = now - known.grew;
    sources_.push_back({.name = source.name,
                        .health = source.health,
                        .since_sample = known.ever ? std::optional{age} : std::nullopt,
                        .silent = age > kSilence ? std::optional{age} : std::nullopt});
  }
}

nlohmann::json to_json(const std::vector<WatchedSource>& sources) {
  nlohmann::json all = nlohmann::json::object();
  for (const WatchedSource& source : sources) {
    const auto& [name, health, since_sample, silent] = source;
    all[name] = {
        {"state", state_name(source)},
        {"last_sample_s", since_sample ? nlohmann::json(to_seconds(*since_sample)) : nullptr},
        {"reason", health.reason},
        {"delivered", health.delivered},
        {"rejected", health.rejected},
        {"dropped", health.dropped}};
  }
  return all;
}

}  // namespace geoflow::daemon::service
