#include "src/world_player.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/world.hpp"

namespace geoflow::emulator {

void WorldPlayer::run(bool running, HostTime now) noexcept {
  if (running && !running_) {
    start_ = now - paused_at_;
  } else if (!running && running_) {
    paused_at_ = std::max(now - start_, newest_);
  }
  running_ = running;
}

void WorldPlayer::look_ahead() {
  while (!ahead_ && !ended_) {
    auto sample = world_->next();
    if (!sample) {
      ++errors_;
    } else {
      ahead_ = std::move(*sample);
      ended_ = !ahead_;
    }
  }
}

std::optional<WorldSample> WorldPlayer::next(HostTime now) {
  if (next_due() > now) {
    return std::nullopt;
  }
  auto sample = std::exchange(ahead_, std::nullopt);
  if (sample) {
    newest_ = sample->t_sent;
    start_ = sample->resumes ? now - sample->t_sent : start_;
    shift_ = host_time(sample->t_sent).time_since_epoch() - sample->t_sent_recorded;
  }
  return sample;
}

HostTime WorldPlayer::next_due() {
  if (!running_) {
    return HostTime::max();
  }
  look_ahead();
  return ahead_ ? host_time(ahead_->t_sent) : HostTime::max();
}

}  // namespace geoflow::emulator
