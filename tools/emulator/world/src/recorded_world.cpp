#include "geoflow/tools/emulator/recorded_world.hpp"

#include <deque>
#include <memory>
#include <optional>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/world.hpp"

namespace geoflow::emulator {
namespace {

using drivers::RecordedStreams;

/// Between the last sample of one round and the first of the next.
constexpr Duration kBetweenRounds{33'333'333};

/// Takes the samples that a recording delivers.
class Collector final : public CameraSink, public ImuSink {
 public:
  /// `device_stamps`: t is the device's own stamp, which lies on the recording's time line.
  void use_device_stamps(bool device_stamps) noexcept { device_stamps_ = device_stamps; }

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override { add(frame); }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override { add(frame); }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override { add(sample); }

  /// Times are on the recording's time line.
  [[nodiscard]] std::optional<WorldSample> take() {
    if (samples_.empty()) {
      return std::nullopt;
    }
    WorldSample sample = std::move(samples_.front());
    samples_.pop_front();
    return sample;
  }

 private:
  template <typename Clock, typename Sample>
  void add(const Arrival<Clock, Sample>& arrival) {
    const Duration t_sent = arrival.t_arrival.time_since_epoch();
    samples_.push_back({.t = device_stamps_ ? arrival.t_device.time_since_epoch() : t_sent,
                        .t_sent = t_sent,
                        .t_sent_recorded = t_sent,
                        .sample = arrival.sample});
  }

  bool device_stamps_ = false;
  std::deque<WorldSample> samples_;
};

class RecordedWorld final : public World {
 public:
  explicit RecordedWorld(const RecordedWorldOptions& options) : options_{options} {}
  RecordedWorld(const RecordedWorld&) = delete;
  RecordedWorld& operator=(const RecordedWorld&) = delete;
  ~RecordedWorld() override { close(); }

  [[nodiscard]] Result<void> open();
  [[nodiscard]] const Calibration& calibration() const override { return calibration_; }
  [[nodiscard]] Result<std::optional<WorldSample>> next() override;

 private:
  void close() noexcept;
  /// At the end: the first sample again, where the options say so.
  [[nodiscard]] Result<void> begin_again();
  [[nodiscard]] WorldSample on_our_time_line(WorldSample sample);

  RecordedWorldOptions options_;
  Calibration calibration_;
  Collector collector_;
  std::unique_ptr<RecordedStreams> streams_;
  /// What is subtracted from the recording's times in this round.
  std::optional<Duration> origin_;
  Duration round_start_{};
  Duration last_sent_{};
};

Result<void> RecordedWorld::open() {
  auto opened = RecordedStreams::open({.path = options_.path, .calibration = options_.calibration});
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  if (!(*opened)->info().has(drivers::StreamId::kColor) &&
      !(*opened)->info().has(drivers::StreamId::kDepth)) {
    return fail(ErrorCode::kInvalidData, "{}: a recording without images is no camera's",
                options_.path.string());
  }
  streams_ = std::move(*opened);
  calibration_ = streams_->calibration();
  const bool host_stamped =
      streams_->camera().stamps().domain == StampDomain::kHost &&
      (streams_->imu() == nullptr || streams_->imu()->stamps().domain == StampDomain::kHost);
  collector_.use_device_stamps(host_stamped);
  auto started = streams_->camera().start(collector_);
  if (started && streams_->imu() != nullptr) {
    started = streams_->imu()->start(collector_);
  }
  origin_.reset();
  return started;
}

void RecordedWorld::close() noexcept {
  if (streams_) {
    streams_->camera().stop();
    if (streams_->imu() != nullptr) {
      streams_->imu()->stop();
    }
    streams_.reset();
  }
}

WorldSample RecordedWorld::on_our_time_line(WorldSample sample) {
  if (!origin_) {
    origin_ = sample.t_sent - round_start_;
    sample.resumes = round_start_ > Duration::zero();
  }
  sample.t -= *origin_;
  sample.t_sent -= *origin_;
  last_sent_ = sample.t_sent;
  return sample;
}

Result<void> RecordedWorld::begin_again() {
  close();
  if (!options_.loop || !origin_) {
    return {};
  }
  round_start_ = last_sent_ + kBetweenRounds;
  auto opened = open();
  if (!opened) {
    close();
  }
  return opened;
}

Result<std::optional<WorldSample>> RecordedWorld::next() {
  while (streams_) {
    if (auto sample = collector_.take()) {
      return on_our_time_line(std::move(*sample));
    }
    const auto stepped = streams_->step();
    if (!stepped) {
      return tl::unexpected{stepped.error()};
    }
    if (*stepped) {
      continue;
    }
    if (auto again = begin_again(); !again) {
      return tl::unexpected{std::move(again.error())};
    }
  }
  return std::nullopt;
}

}  // namespace

Result<std::unique_ptr<World>> open_recorded_world(const RecordedWorldOptions& options) {
  auto world = std::make_unique<RecordedWorld>(options);
  if (auto opened = world->open(); !opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  return world;
}

}  // namespace geoflow::emulator
