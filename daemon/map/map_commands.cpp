#include "map/map_commands.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "map/map_job.hpp"
#include "map/map_keeper.hpp"
#include "server/control_connection.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::size_t kMostAskers = 256;  // for one job
constexpr Duration kWaitForRun = std::chrono::seconds{2};
constexpr Duration kShowEvery = std::chrono::seconds{5};

nlohmann::json describe(const MapReport& report) {
  switch (report.job) {
    case MapJob::kSave:
      return {{"saved", report.file.string()},
              {"keyframes", report.keyframes},
              {"bytes", report.bytes}};
    case MapJob::kForget:
      return {{"moved", report.moved.string()}};
    case MapJob::kLoad:
      return {{"loaded", report.file.string()},
              {"moved", report.moved.string()},
              {"keyframes", report.keyframes}};
    case MapJob::kRestart:
    case MapJob::kShow:
      break;
  }
  return {{"keyframes", report.keyframes}};
}

}  // namespace

void MapCommands::ask(const MapOrder& order, const Asker& asker, HostTime now) {
  auto waiting = std::ranges::find(queue_, order, &Request::order);
  if (waiting == queue_.end()) {
    waiting = queue_.insert(queue_.end(), Request{.order = order, .since = now, .askers = {}});
  }
  if (waiting->askers.size() >= kMostAskers) {
    answer_(asker, fail(ErrorCode::kUnavailable, "too many ask for this"));
    return;
  }
  waiting->askers.push_back(asker);
}

void MapCommands::turn(MapKeeper* keeper, Duration interval, HostTime now) {
  if (keeper == nullptr) {
    if (!queue_.empty() && now - queue_.front().since > kWaitForRun) {
      abandon("there is no map: the source is not open");
    }
    return;
  }
  if (const auto outcome = keeper->take_outcome()) {
    conclude(*outcome, now);
  }
  if (keeper->busy()) {
    return;
  }
  if (!queue_.empty()) {
    Request request = std::move(queue_.front());
    queue_.pop_front();
    begin(*keeper, std::move(request), now);
    return;
  }
  if (const auto job = due(*keeper, interval, now)) {
    begin(*keeper, {.order = {.job = *job}, .since = now, .askers = {}}, now);
  }
}

/// What the clock asks for.
std::optional<MapJob> MapCommands::due(const MapKeeper& keeper, Duration interval, HostTime now) {
  tried_at_ = tried_at_.value_or(now);
  if (interval > Duration::zero() && now - *tried_at_ >= interval && keeper.has_news()) {
    return MapJob::kSave;
  }
  const bool may_show = !tried_to_show_at_ || now - *tried_to_show_at_ >= kShowEvery;
  const bool is_new = !shown_ || keeper.mark().mapping_runs != shown_->mapping_runs;
  return wanted_ && may_show && is_new ? std::optional{MapJob::kShow} : std::nullopt;
}

void MapCommands::begin(MapKeeper& keeper, Request request, HostTime now) {
  if (request.order.job == MapJob::kSave) {
    tried_at_ = now;
  } else if (request.order.job == MapJob::kShow) {
    tried_to_show_at_ = now;
  }
  under_way_ = std::move(request);
  if (const auto begun = keeper.begin(under_way_->order); !begun) {
    answer(tl::unexpected{begun.error()});
  }
}

void MapCommands::conclude(const MapOutcome& outcome, HostTime now) {
  if (!outcome.report) {
    note(outcome.job, outcome.report.error());
  } else if (outcome.job == MapJob::kSave) {
    saved_ = *outcome.report;
    saved_at_ = now;
    trouble_.clear();
    log::debug("map", "saved: {}, {} keyframes, {} bytes", saved_.file.string(), saved_.keyframes,
               saved_.bytes);
  } else if (outcome.job == MapJob::kShow) {
    shown_ = outcome.report->mark;
    show_(*outcome.report->cloud);
  } else {
    shown_.reset();
    log::info("map", "the estimator has begun anew, in a map of {} keyframes",
              outcome.report->keyframes);
  }
  answer(outcome.report);
}

void MapCommands::answer(const Result<MapReport>& report) {
  if (const auto request = std::exchange(under_way_, std::nullopt)) {
    for (const Asker& asker : request->askers) {
      answer_(asker, report.map(describe));
    }
  }
}

/// Once, until it changes: a disk that is full stays so for long.
void MapCommands::note(MapJob job, const Error& error) {
  if (job == MapJob::kShow) {
    log::error("map", "it cannot be shown: {}", error.message);
  } else if (job != MapJob::kSave) {
    log::error("map", "the estimator could not begin anew: {}", error.message);
  } else if (error.message != trouble_) {
    trouble_ = error.message;
    log::error("map", "not saved: {}", trouble_);
  }
}

void MapCommands::hold() {
  if (auto request = std::exchange(under_way_, std::nullopt)) {
    queue_.push_front(std::move(*request));
  }
}

void MapCommands::abandon(const std::string& why) {
  hold();
  for (const Request& request : std::exchange(queue_, {})) {
    for (const Asker& asker : request.askers) {
      answer_(asker, fail(ErrorCode::kUnavailable, "{}", why));
    }
  }
}

nlohmann::json MapCommands::status(HostTime now) const {
  nlohmann::json status = {
      {"trouble", trouble_}, {"saved_s", nullptr}, {"keyframes", nullptr}, {"bytes", nullptr}};
  if (saved_at_) {
    status["saved_s"] = to_seconds(now - *saved_at_);
    status["keyframes"] = saved_.keyframes;
    status["bytes"] = saved_.bytes;
  }
  return status;
}

}  // namespace geoflow::daemon
