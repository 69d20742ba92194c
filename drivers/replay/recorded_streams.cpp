#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

#include "port.hpp"
#include "replay/calibration/find.hpp"
#include "replay/decode.hpp"
#include "replay/factory.hpp"
#include "replay/faults/reader.hpp"
#include "replay/faults/script.hpp"
#include "replay/prefetcher.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

constexpr std::size_t kRecentErrors = 32;
constexpr double kLongestWaitS = 1e8;
constexpr HostTime kNotWaiting = HostTime::min();

DecodeOptions decode_options(const Calibration& calibration, const RecordingOptions& options) {
  return {.width = calibration.camera.width,
          .height = calibration.camera.height,
          .color_as_gray = options.color_as_gray,
          .depth_unit_m = calibration.depth_unit_m};
}

HostTime arrival(const DecodedEvent& event) {
  return std::visit([](const auto& sample) { return sample.t_arrival; }, event);
}

/// The sample moved by `shift` on the host's time line; its device time as well where that is the
/// host's.
template <typename Clock, typename Sample>
Arrival<Clock, Sample> shifted(const Arrival<Clock, Sample>& sample, const StampInfo& stamps,
                               Duration shift) {
  Arrival<Clock, Sample> moved = sample;
  moved.t_arrival += shift;
  if (stamps.domain == StampDomain::kHost) {
    moved.t_device += shift;
  }
  return moved;
}

}  // namespace

class RecordedStreams::Implementation {
 public:
  Implementation(std::unique_ptr<RecordingReader> reader, Calibration calibration,
                 const RecordingOptions& options)
      : info_{reader->info()},
        calibration_{std::move(calibration)},
        reference_{reader->reference()},
        camera_{reader->stamps().camera},
        imu_{reader->stamps().imu},
        legs_{reader->stamps().legs},
        now_{info_.start},
        prefetcher_{std::move(reader), decode_options(calibration_, options), options.prefetch} {}

  Result<bool> step() {
    Prefetched item = take();
    if (!item.event) {
      reject(item.event.error());
      return tl::unexpected{std::move(item.event.error())};
    }
    const auto& found = *item.event;
    if (!found) {
      return false;
    }
    deliver(*found);
    return true;
  }

  Result<void> play(const std::stop_token& stop, double speed) {
    if (!(speed > 0) || !std::isfinite(speed)) {
      return fail(ErrorCode::kInvalidArgument, "a replay speed of {} is not positive", speed);
    }
    std::optional<HostTime> first;
    const HostTime begin = HostClock::now();
    while (!stop.stop_requested()) {
      Prefetched item = take();
      if (!item.event) {
        reject(item.event.error());
        continue;
      }
      const auto& found = *item.event;
      if (!found) {
        return {};
      }
      const HostTime t = arrival(*found);
      if (!first) {
        first = t;
        shift_ = begin - t;
      }
      const double ahead_s = std::clamp(to_seconds(t - *first) / speed, 0.0, kLongestWaitS);
      if (!wait_until(begin + from_seconds(ahead_s), stop)) {
        pending_ = std::move(item);
        return {};
      }
      deliver(*found);
    }
    return {};
  }

  [[nodiscard]] std::vector<std::string> recent_errors() const {
    const std::scoped_lock lock{mutex_};
    return {recent_errors_.begin(), recent_errors_.end()};
  }

  [[nodiscard]] const RecordingInfo& info() const { return info_; }
  [[nodiscard]] const Calibration& calibration() const { return calibration_; }
  [[nodiscard]] const Trajectory& reference() const { return reference_; }
  [[nodiscard]] const FaultCounters& faults() const { return faults_; }
  [[nodiscard]] HostTime now() const { return now_; }
  [[nodiscard]] Duration shift() const { return shift_; }
  [[nodiscard]] std::optional<HostTime> waits_until() const {
    const HostTime t = waits_until_.load(std::memory_order_acquire);
    return t == kNotWaiting ? std::nullopt : std::optional{t};
  }
  [[nodiscard]] DecodeStatistics decode_statistics() const { return prefetcher_.statistics(); }
  [[nodiscard]] DepthCamera& camera() { return camera_; }
  [[nodiscard]] Imu* imu() { return info_.has(StreamId::kImu) ? &imu_ : nullptr; }
  [[nodiscard]] Legs* legs() {
    return info_.has(StreamId::kLegs) || info_.has(StreamId::kBodyVelocity) ? &legs_ : nullptr;
  }

 private:
  Prefetched take() {
    Prefetched item = pending_ ? *std::move(pending_) : prefetcher_.take();
    pending_.reset();
    if (item.faults) {
      faults_ = *item.faults;
    }
    if (item.event && !*item.event) {
      camera_.end(item.complete);
      imu_.end(item.complete);
      legs_.end(item.complete);
    }
    return item;
  }

  /// True when it is time, false when stopped before.
  [[nodiscard]] bool wait_until(HostTime t, const std::stop_token& stop) {
    std::unique_lock lock{mutex_};
    waits_until_.store(t, std::memory_order_release);
    wake_.wait_until(lock, stop, t, [] { return false; });
    waits_until_.store(kNotWaiting, std::memory_order_release);
    return !stop.stop_requested();
  }

  void reject(const Error& error) {
    camera_.count_rejected(error.message);
    const std::scoped_lock lock{mutex_};
    if (recent_errors_.size() == kRecentErrors) {
      recent_errors_.pop_front();
    }
    recent_errors_.push_back(error.message);
  }

  void deliver(const DecodedEvent& event) {
    now_ = arrival(event) + shift_.load();
    std::visit([this](const auto& sample) { hand_over(sample); }, event);
  }

  void hand_over(const Arrival<CameraClock, ColorFrame>& sample) {
    camera_.deliver(
        [&](CameraSink& sink) { sink.on_color(shifted(sample, camera_.stamps(), shift_)); });
  }
  void hand_over(const Arrival<CameraClock, DepthFrame>& sample) {
    camera_.deliver(
        [&](CameraSink& sink) { sink.on_depth(shifted(sample, camera_.stamps(), shift_)); });
  }
  void hand_over(const Arrival<ImuClock, ImuSample>& sample) {
    imu_.deliver([&](ImuSink& sink) { sink.on_imu(shifted(sample, imu_.stamps(), shift_)); });
  }
  void hand_over(const Arrival<LegClock, LegSample>& sample) {
    legs_.deliver([&](LegSink& sink) { sink.on_legs(shifted(sample, legs_.stamps(), shift_)); });
  }
  void hand_over(const Arrival<LegClock, BodyVelocitySample>& sample) {
    legs_.deliver(
        [&](LegSink& sink) { sink.on_body_velocity(shifted(sample, legs_.stamps(), shift_)); });
  }

  RecordingInfo info_;
  Calibration calibration_;
  Trajectory reference_;
  Port<CameraSink> camera_;
  Port<ImuSink> imu_;
  Port<LegSink> legs_;
  FaultCounters faults_;
  std::optional<Prefetched> pending_;  // taken by a play() that was stopped before its time
  std::atomic<HostTime> now_;
  std::atomic<Duration> shift_ = Duration{};  // of play()
  std::atomic<HostTime> waits_until_ = kNotWaiting;
  mutable std::mutex mutex_;  // guards recent_errors_; and for wake_, which only a stop wakes
  std::condition_variable_any wake_;
  std::deque<std::string> recent_errors_;
  Prefetcher prefetcher_;
};

RecordedStreams::RecordedStreams(std::unique_ptr<Implementation> implementation)
    : implementation_{std::move(implementation)} {}
RecordedStreams::~RecordedStreams() = default;

Result<std::unique_ptr<RecordedStreams>> RecordedStreams::open(const RecordingOptions& options) {
  auto reader = open_recording(options);
  if (!reader) {
    return tl::unexpected{std::move(reader.error())};
  }
  auto calibration = find_calibration(options, **reader);
  if (!calibration) {
    return tl::unexpected{std::move(calibration.error())};
  }
  if (options.faults) {
    auto script = faults::load_script(*options.faults);
    if (!script) {
      return tl::unexpected{std::move(script.error())};
    }
    reader = faults::with_faults(*std::move(reader), *std::move(script), options.fault_seed);
  }
  return std::unique_ptr<RecordedStreams>{new RecordedStreams{
      std::make_unique<Implementation>(*std::move(reader), *std::move(calibration), options)}};
}

const RecordingInfo& RecordedStreams::info() const {
  return implementation_->info();
}
const Calibration& RecordedStreams::calibration() const {
  return implementation_->calibration();
}
const Trajectory& RecordedStreams::reference() const {
  return implementation_->reference();
}
FaultCounters RecordedStreams::faults() const {
  return implementation_->faults();
}
DepthCamera& RecordedStreams::camera() {
  return implementation_->camera();
}
Imu* RecordedStreams::imu() {
  return implementation_->imu();
}
Legs* RecordedStreams::legs() {
  return implementation_->legs();
}
Result<bool> RecordedStreams::step() {
  return implementation_->step();
}
HostTime RecordedStreams::now() const {
  return implementation_->now();
}
Result<void> RecordedStreams::play(const std::stop_token& stop, double speed) {
  return implementation_->play(stop, speed);
}
HostTime RecordedStreams::to_recording_time(HostTime t) const {
  return t - implementation_->shift();
}
std::optional<HostTime> RecordedStreams::waits_until() const {
  return implementation_->waits_until();
}
DecodeStatistics RecordedStreams::decode_statistics() const {
  return implementation_->decode_statistics();
}
std::vector<std::string> RecordedStreams::recent_errors() const {
  return implementation_->recent_errors();
}

}  // namespace geoflow::drivers
