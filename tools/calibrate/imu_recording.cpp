#include "calibrate/imu_recording.hpp"

#include <array>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <optional>

#include <tl/expected.hpp>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

/// FNV-1a, 64 bit (G. Fowler, L. Noll, K.-P. Vo).
constexpr std::uint64_t kFnvStart = 0xcbf29ce484222325;
constexpr std::uint64_t kFnvPrime = 0x100000001b3;

template <typename Number>
std::uint64_t hashed(std::uint64_t hash, const Number& number) {
  for (const auto byte : std::bit_cast<std::array<std::uint8_t, sizeof(Number)>>(number)) {
    hash = (hash ^ byte) * kFnvPrime;
  }
  return hash;
}

class Collector final : public ImuSink {
 public:
  Collector(const StampInfo& stamps, ImuRecording& recording)
      : wrap_{stamps.wrap}, recording_{recording} {}

  void on_imu(const Arrival<ImuClock, ImuSample>& arrival) override {
    Duration t = arrival.t_device.time_since_epoch() + turns_ * wrap_.value_or(Duration{});
    if (wrap_ && !recording_.samples.empty() &&
        t + *wrap_ / 2 < recording_.samples.back().t.time_since_epoch()) {
      ++turns_;
      t += *wrap_;
    }
    recording_.samples.push_back({.t = HostTime{t}, .sample = arrival.sample});
    recording_.hash = hashed(recording_.hash, t.count());
    for (const Vector3d& values : {arrival.sample.accel_mps2, arrival.sample.gyro_radps}) {
      for (const double value : values) {
        recording_.hash = hashed(recording_.hash, value);
      }
    }
  }

 private:
  std::optional<Duration> wrap_;
  std::int64_t turns_ = 0;
  ImuRecording& recording_;
};

}  // namespace

Result<ImuRecording> read_imu(const std::filesystem::path& recording) {
  drivers::RecordingOptions options{.path = recording};
  options.topics.color = options.topics.depth = options.topics.legs = options.topics.odometry = "";
  auto streams = drivers::RecordedStreams::open(options);
  if (!streams) {
    return tl::unexpected{streams.error()};
  }
  Imu* imu = (*streams)->imu();
  if (imu == nullptr) {
    return fail(ErrorCode::kNotFound, "{}: has no inertial samples", recording.string());
  }
  ImuRecording result;
  result.serial = (*streams)->calibration().serial;
  result.hash = kFnvStart;
  Collector collector{imu->stamps(), result};
  if (auto started = imu->start(collector); !started) {
    return tl::unexpected{started.error()};
  }
  for (auto more = (*streams)->step(); !more || *more; more = (*streams)->step()) {
    if (!more) {
      ++result.rejected;
    }
  }
  imu->stop();
  return result;
}

}  // namespace geoflow::tools
