#include "emulate/leg_sources.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <optional>
#include <utility>

#include <sys/timerfd.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/leg_simulator.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::tools {
namespace {

constexpr double kWayM = 5;  // of the simulated walk, one way

/// Waits for instants, or for a signal.
class Alarm {
 public:
  static Result<Alarm> create() {
    UniqueFd fd{::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC)};
    if (!fd) {
      return fail_errno("timerfd");
    }
    return Alarm{std::move(fd)};
  }
  void wait_until(HostTime t) const {
    const auto seconds = std::chrono::floor<std::chrono::seconds>(t.time_since_epoch());
    itimerspec at{};
    at.it_value = {.tv_sec = static_cast<time_t>(seconds.count()),
                   .tv_nsec = static_cast<long>((t.time_since_epoch() - seconds).count())};
    std::uint64_t rung = 0;
    if (::timerfd_settime(fd_.get(), TFD_TIMER_ABSTIME, &at, nullptr) == 0) {
      (void)!::read(fd_.get(), &rung, sizeof rung);
    }
  }

 private:
  explicit Alarm(UniqueFd fd) : fd_{std::move(fd)} {}
  UniqueFd fd_;
};

/// Puts a recording's samples together and hands them on when it is their time.
class RecordedSink final : public LegSink, public ImuSink {
 public:
  RecordedSink(std::optional<Matrix3d> R_base_imu, std::optional<Duration> shift, Duration offset,
               const Alarm& alarm, const SampleHandler& handler)
      : R_base_imu_{std::move(R_base_imu)},
        shift_{shift},
        offset_{offset},
        alarm_{alarm},
        handler_{handler} {}

  void on_legs(const Arrival<LegClock, LegSample>& sample) override {
    shift_ = shift_.value_or(begin_ - sample.t_arrival);
    const HostTime due = sample.t_arrival + *shift_;
    if (due < begin_) {
      return;
    }
    first_ = first_.value_or(sample.t_device);
    const Duration since = sample.t_device - *first_;
    if (since < Duration::zero()) {
      return;
    }
    alarm_.wait_until(due);
    wanted_ = handler_({.legs = sample.sample, .body_imu = imu_, .device_time = offset_ + since});
  }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& /*sample*/) override {}
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
    if (R_base_imu_) {
      imu_ = {.accel_mps2 = *R_base_imu_ * sample.sample.accel_mps2,
              .gyro_radps = *R_base_imu_ * sample.sample.gyro_radps};
    }
  }
  /// False once the handler has said that it is enough.
  [[nodiscard]] bool wanted() const noexcept { return wanted_; }

 private:
  std::optional<Matrix3d> R_base_imu_;
  std::optional<Duration> shift_;
  Duration offset_;
  const Alarm& alarm_;
  const SampleHandler& handler_;
  std::optional<DeviceTime<LegClock>> first_;
  ImuSample imu_;
  HostTime begin_ = HostClock::now();
  bool wanted_ = true;
};

}  // namespace

Result<void> play_recorded_legs(const std::filesystem::path& recording,
                                std::optional<Duration> shift, Duration offset,
                                const SampleHandler& handler) {
  auto streams = drivers::RecordedStreams::open({.path = recording, .color_as_gray = true});
  const auto alarm = Alarm::create();
  if (!streams || !alarm) {
    return tl::unexpected{streams ? alarm.error() : streams.error()};
  }
  Legs* const legs = (*streams)->legs();
  if (legs == nullptr || !(*streams)->info().has(drivers::StreamId::kLegs)) {
    return fail(ErrorCode::kNotFound, "{}: the recording has no legs", recording.string());
  }
  const Calibration& calibration = (*streams)->calibration();
  std::optional<Matrix3d> R_base_imu;
  if (calibration.T_base_cam && calibration.T_cam_imu) {
    R_base_imu = (*calibration.T_base_cam * *calibration.T_cam_imu).rotation_matrix();
  }
  RecordedSink sink{std::move(R_base_imu), shift, offset, *alarm, handler};
  auto started = legs->start(sink);
  if (started && (*streams)->imu() != nullptr) {
    started = (*streams)->imu()->start(sink);
  }
  bool more = true;
  while (started && more && sink.wanted()) {
    more = (*streams)->step().value_or(true);  // an error concerns one sample, which is left out
  }
  return started;
}

Result<void> play_simulated_legs(const SimulatedLegs& options, Duration offset,
                                 const SampleHandler& handler) {
  const std::array<Vector2d, 2> way{Vector2d::Zero(), Vector2d{kWayM, 0}};
  const auto walk =
      simulator::plan_walk(way, {.seed = options.seed, .duration_s = options.duration_s});
  const auto alarm = Alarm::create();
  if (!walk || !alarm) {
    return tl::unexpected{walk ? alarm.error() : walk.error()};
  }
  const simulator::LegSimulator legs{*walk, options.seed, {}};
  const SE3 T_base_imu = drivers::body_imu_in_base();
  const HostTime begin = HostClock::now();
  for (std::size_t i = 0; i < legs.size(); ++i) {
    const simulator::LegReading reading = legs.reading(i);
    const Duration t = from_seconds(reading.t_s);
    alarm->wait_until(begin + t);
    if (!handler({.legs = reading.sample,
                  .body_imu = simulator::ideal_imu(walk->body().at(reading.t_s), T_base_imu),
                  .device_time = offset + t})) {
      break;
    }
  }
  return {};
}

}  // namespace geoflow::tools
