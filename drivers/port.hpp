#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers {

/// One port of a source: whoever steps or runs the source delivers through it. Thread-safe, but
/// start, stop and health must not be called from inside the sink.
template <typename Sink>
class Port final : public Source<Sink> {
 public:
  explicit Port(const StampInfo& stamps) : stamps_{stamps} {}

  [[nodiscard]] Result<void> start(Sink& sink) override {
    const std::scoped_lock lock{mutex_};
    if (sink_ != nullptr) {
      return fail(ErrorCode::kUnavailable, "this stream is started already");
    }
    sink_ = &sink;
    health_.state = SourceState::kStreaming;
    health_.reason.clear();
    return {};
  }

  void stop() override {
    const std::scoped_lock lock{mutex_};
    sink_ = nullptr;
    health_.state = SourceState::kStopped;
  }

  [[nodiscard]] SourceHealth health() const override {
    const std::scoped_lock lock{mutex_};
    return health_;
  }

  [[nodiscard]] StampInfo stamps() const override { return stamps_; }

  /// Calls `use(sink)` if there is one, and counts.
  template <typename Use>
  void deliver(const Use& use) {
    const std::scoped_lock lock{mutex_};
    if (sink_ == nullptr) {
      return;
    }
    use(*sink_);
    ++health_.delivered;
    if (reported_ == SourceState::kStreaming) {
      set_state(SourceState::kStreaming, {});
    }
  }

  /// How the source is, for the port of a device: it stands until the next report. `rejected` is
  /// how many samples could not be used so far.
  void report(SourceState state, const std::string& reason, std::uint64_t rejected) {
    const std::scoped_lock lock{mutex_};
    reported_ = state;
    health_.rejected = rejected;
    set_state(state, reason);
  }

  void count_rejected(const std::string& reason) {
    const std::scoped_lock lock{mutex_};
    ++health_.rejected;
    set_state(SourceState::kDegraded, reason);
  }

  /// A sample was lost because all buffers are in use.
  void count_dropped() {
    const std::scoped_lock lock{mutex_};
    ++health_.dropped;
  }

  /// Nothing comes, or not all that should; the next sample that is delivered says that all is
  /// well.
  void set_degraded(const std::string& reason) {
    const std::scoped_lock lock{mutex_};
    set_state(SourceState::kDegraded, reason);
  }

  /// The recording has ended: as it should, or before its end.
  void end(bool complete) {
    const std::scoped_lock lock{mutex_};
    if (complete) {
      set_state(SourceState::kStopped, "the recording has ended");
    } else {
      set_state(SourceState::kFailed, "the recording is cut off: " + health_.reason);
    }
  }

 private:
  void set_state(SourceState state, std::string reason) {
    if (sink_ != nullptr) {
      health_.state = state;
      health_.reason = std::move(reason);
    }
  }

  StampInfo stamps_;
  mutable std::mutex mutex_;  // held while the sink runs, so that stop() waits for it
  Sink* sink_ = nullptr;
  SourceHealth health_;
  SourceState reported_ = SourceState::kStreaming;
};

}  // namespace geoflow::drivers
