#include "service/status_line.hpp"

#include <chrono>
#include <cmath>
#include <cstdint>
#include <string>

#include <fmt/core.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/time.hpp"

#include "service/source_watch.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr Duration kRateWindow = std::chrono::seconds{3};

}  // namespace

std::string StatusLine::update(const Observation& seen, HostTime now) {
  std::string line = describe_pose(seen, now);
  const char* separator = "; ";
  if (!seen.trouble.empty()) {
    line += separator + seen.trouble;
  }
  for (const WatchedSource& source : seen.sources) {
    line += separator + describe(source);
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

}  // namespace geoflow::daemon::service
