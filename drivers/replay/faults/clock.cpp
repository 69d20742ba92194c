#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/faults/script.hpp"
#include "replay/faults/stage.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::faults {
namespace {

/// Shifts device times by an amount that depends on the true time.
class ClockStage final : public Stage {
 public:
  ClockStage(const Fault& fault, const StageContext& context) : fault_{fault}, context_{context} {}

  void apply(Event event, std::vector<Event>& out) override {
    const StreamId stream = stream_of(event);
    if (fault_.touches(stream)) {
      const Duration error = error_at(arrival_of(event) - context_.start);
      if (error != Duration{}) {
        std::visit([error](auto& sample) { sample.t_device += error; }, event);
        ++context_.counters->of(fault_.kind, stream);
      }
    }
    out.push_back(std::move(event));
  }

 private:
  [[nodiscard]] Duration error_at(Duration since_start) const {
    constexpr double kPerMillion = 1e-6;
    if (since_start < fault_.from) {
      return {};
    }
    if (fault_.kind == FaultKind::kClockDrift) {  // what has gathered stays
      const Duration drifting = std::min(since_start, fault_.until) - fault_.from;
      return from_seconds(to_seconds(drifting) * fault_.drift_ppm * kPerMillion);
    }
    return since_start < fault_.until ? fault_.offset : Duration{};
  }

  Fault fault_;
  StageContext context_;
};

/// Turns device times into what a 32-bit counter of microseconds shows.
class WrapStage final : public Stage {
 public:
  WrapStage(const Fault& fault, const StageContext& context) : fault_{fault}, context_{context} {}

  void apply(Event event, std::vector<Event>& out) override {
    const StreamId stream = stream_of(event);
    if (fault_.touches(stream)) {
      std::visit([&](auto& sample) { wrap(sample.t_device, stream); }, event);
    }
    out.push_back(std::move(event));
  }

 private:
  template <typename DeviceTimePoint>
  void wrap(DeviceTimePoint& t, StreamId stream) {
    using std::chrono::microseconds;
    const Duration since_wrap =
        t.time_since_epoch() - context_.start.time_since_epoch() - fault_.first_wrap;
    const auto ticks = std::chrono::floor<microseconds>(since_wrap).count();
    constexpr std::int64_t kTicks = std::int64_t{1} << 32U;
    const std::int64_t turns = ticks >= 0 ? ticks / kTicks : (ticks + 1) / kTicks - 1;
    if (turn_ && turns > *turn_) {
      ++context_.counters->of(fault_.kind, stream);
    }
    turn_ = std::max(turns, turn_.value_or(turns));
    t = DeviceTimePoint{microseconds{ticks - turns * kTicks}};
  }

  Fault fault_;
  StageContext context_;
  std::optional<std::int64_t> turn_;
};

}  // namespace

std::unique_ptr<Stage> make_clock_stage(const Fault& fault, const StageContext& context) {
  if (fault.kind == FaultKind::kClockWrap) {
    return std::make_unique<WrapStage>(fault, context);
  }
  return std::make_unique<ClockStage>(fault, context);
}

}  // namespace geoflow::drivers::faults
