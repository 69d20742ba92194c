#include "replay/faults/reader.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

#include "replay/faults/script.hpp"
#include "replay/faults/stage.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::faults {
namespace {

class FaultReader final : public RecordingReader {
 public:
  FaultReader(std::unique_ptr<RecordingReader> inner, const std::vector<Fault>& faults,
              std::uint64_t seed)
      : inner_{std::move(inner)}, stamps_{inner_->stamps()} {
    const auto wraps = [](const Fault& fault) { return fault.kind == FaultKind::kClockWrap; };
    std::vector<Fault> ordered;
    std::ranges::copy_if(faults, std::back_inserter(ordered), std::not_fn(wraps));
    std::ranges::copy_if(faults, std::back_inserter(ordered), wraps);
    for (const Fault& fault : ordered) {
      // Each fault draws from a sequence of its own: a change of one leaves the others as they
      // were.
      std::seed_seq sequence{seed, seed >> 32U, std::uint64_t{stages_.size()}};
      std::vector<std::uint32_t> words(2);
      sequence.generate(words.begin(), words.end());
      stages_.push_back(make_stage(fault, {.start = inner_->info().start,
                                           .seed = (std::uint64_t{words[0]} << 32U) | words[1],
                                           .counters = &counters_}));
      mark_clock(fault);
    }
  }

  [[nodiscard]] const RecordingInfo& info() const override { return inner_->info(); }
  [[nodiscard]] FoundCalibration calibration() const override { return inner_->calibration(); }
  [[nodiscard]] Trajectory reference() const override { return inner_->reference(); }
  [[nodiscard]] RecordingStamps stamps() const override { return stamps_; }
  [[nodiscard]] bool complete() const override { return inner_->complete(); }
  [[nodiscard]] const FaultCounters* faults() const override { return &counters_; }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    while (!ended_ && (waiting_.empty() || arrival_of(waiting_.front().event) > horizon_)) {
      auto event = inner_->next();
      if (!event) {
        return event;
      }
      if (std::optional<Event>& found = *event) {
        horizon_ = std::max(horizon_, arrival_of(*found));
        pass({*std::move(found)}, 0);
      } else {
        ended_ = true;
        finish();
      }
    }
    if (waiting_.empty()) {
      return std::nullopt;
    }
    std::ranges::pop_heap(waiting_, later);
    Event event = std::move(waiting_.back().event);
    waiting_.pop_back();
    return event;
  }

 private:
  struct Waiting {
    Event event;
    std::uint64_t sequence;
  };

  static bool later(const Waiting& a, const Waiting& b) {
    return std::tuple{arrival_of(a.event), a.sequence} >
           std::tuple{arrival_of(b.event), b.sequence};
  }

  void mark_clock(const Fault& fault) {
    if (!is_clock_fault(fault.kind)) {
      return;
    }
    StampInfo& info = fault.touches(StreamId::kColor) ? stamps_.camera
                      : fault.touches(StreamId::kImu) ? stamps_.imu
                                                      : stamps_.legs;
    info.domain = StampDomain::kDevice;
    if (&info != &stamps_.legs) {
      stamps_.imu.on_camera_clock = false;  // the two no longer run alike
    }
    if (fault.kind == FaultKind::kClockWrap) {
      info.wrap = kWrapPeriod;
    }
  }

  /// Sends events through the stages from `stage` on.
  void pass(std::vector<Event> events, std::size_t stage) {
    for (; stage < stages_.size(); ++stage) {
      std::vector<Event> changed;
      for (Event& event : events) {
        stages_[stage]->apply(std::move(event), changed);
      }
      events = std::move(changed);
    }
    for (Event& event : events) {
      waiting_.push_back({.event = std::move(event), .sequence = sequence_++});
      std::ranges::push_heap(waiting_, later);
    }
  }

  void finish() {
    for (std::size_t stage = 0; stage < stages_.size(); ++stage) {
      std::vector<Event> rest;
      stages_[stage]->finish(rest);
      for (Event& event : rest) {  // later samples have been returned already
        std::visit(
            [this](auto& sample) { sample.t_arrival = std::max(sample.t_arrival, horizon_); },
            event);
      }
      pass(std::move(rest), stage + 1);
    }
  }

  std::unique_ptr<RecordingReader> inner_;
  RecordingStamps stamps_;
  FaultCounters counters_;
  std::vector<std::unique_ptr<Stage>> stages_;
  std::vector<Waiting> waiting_;  // a heap, earliest first
  std::uint64_t sequence_ = 0;
  HostTime horizon_ = HostTime::min();  // no later event of the inner reader arrives before
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<RecordingReader> with_faults(std::unique_ptr<RecordingReader> inner,
                                             const std::vector<Fault>& faults, std::uint64_t seed) {
  return std::make_unique<FaultReader>(std::move(inner), faults, seed);
}

}  // namespace geoflow::drivers::faults
