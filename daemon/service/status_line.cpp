#include "service/status_line.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <string>

#include <fmt/core.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr Duration kSilence = std::chrono::milliseconds{1500};
constexpr Duration kRateWindow = std::chrono::seconds{3};

}  // namespace

std::string StatusLine::update(const Observation& seen, HostTime now) {
  std::string line = describe_pose(seen, now);
  const char* separator = "; ";
  if (!seen.trouble.empty()) {
    line += separator + seen.trouble;
  }
  for (const NamedHealth& source : seen.sources) {
    line += separator + describe(source, now);
    separator = ", ";
  }
  return line;
}

std::string StatusLine::describe_pose(const Observation& seen, HostTime now) {
  const double rate = rate_hz(seen.frames, now);
  if (!seen.pose) {
    return "STARTING";
  }
  if (status_ != seen.pose->status) {
    status_ = seen.pose->status;
    since_ = now;
  }
  return fmt::format("{} {:.0f} Hz, quality {}, {}", status_name(seen.pose->status), rate,
                     seen.pose->quality, in_words(now - since_));
}

double StatusLine::rate_hz(std::uint64_t frames, HostTime now) {
  // A source that begins anew counts anew.
  if (!frames_.empty() && frames < frames_.back().count) {
    frames_.clear();
  }
  frames_.push_back({.count = frames, .t = now});
  while (frames_.size() > 2 && now - frames_[1].t >= kRateWindow) {
    frames_.erase(frames_.begin());
  }
  const double seconds = to_seconds(now - frames_.front().t);
  return seconds > 0 ? static_cast<double>(frames - frames_.front().count) / seconds : 0;
}

std::string StatusLine::describe(const NamedHealth& source, HostTime now) {
  const SourceHealth& health = source.health;
  auto count = std::ranges::find(counts_, source.name, &Count::name);
  if (count == counts_.end()) {
    count = counts_.insert(counts_.end(),
                           {.name = source.name, .delivered = health.delivered, .grew = now});
  }
  if (count->delivered != health.delivered) {
    *count = {.name = source.name, .delivered = health.delivered, .grew = now};
  }
  const std::string reason = health.reason.empty() ? "" : fmt::format(" ({})", health.reason);
  if (now - count->grew > kSilence) {
    return fmt::format("{} silent {}{}", source.name, in_words(now - count->grew), reason);
  }
  switch (health.state) {
    case SourceState::kDegraded:
      return fmt::format("{} degraded{}", source.name, reason);
    case SourceState::kFailed:
      return fmt::format("{} failed{}", source.name, reason);
    case SourceState::kStopped:
    case SourceState::kStreaming:
      break;
  }
  return source.name + " ok";
}

}  // namespace geoflow::daemon::service
