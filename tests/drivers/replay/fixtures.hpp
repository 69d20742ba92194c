#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// Small recordings made on the spot, and a sink that remembers.
namespace geoflow::drivers::tests {

inline constexpr int kWidth = 32;
inline constexpr int kHeight = 24;

void write_text(const std::filesystem::path& path, std::string_view content);

/// A colour image filled with `value`, as .png or .jpg by the path's extension.
void write_color(const std::filesystem::path& path, int value, int width = kWidth,
                 int height = kHeight);
/// A 16-bit PNG filled with `value`.
void write_depth(const std::filesystem::path& path, std::uint16_t value, int width = kWidth,
                 int height = kHeight);

/// A camchain.yaml for kWidth x kHeight images, 1000 counts per metre.
void write_camchain(const std::filesystem::path& directory);

/// A TUM recording of `count` frames at 30 Hz from 100 s on, depth 1 ms behind colour, frame i
/// filled with i.
void write_tum(const std::filesystem::path& directory, int count);

/// Everything that came, in order: `c`, `d`, `i`, `l`, `v` and the arrival time.
class Recorder final : public CameraSink, public ImuSink, public LegSink {
 public:
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override;
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override;
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override;
  void on_legs(const Arrival<LegClock, LegSample>& sample) override;
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override;

  std::string order;
  std::vector<HostTime> arrivals;
  std::vector<Arrival<CameraClock, ColorFrame>> colors;
  std::vector<Arrival<CameraClock, DepthFrame>> depths;
  std::vector<Arrival<ImuClock, ImuSample>> imus;
};

/// Steps to the end; the texts of rejected samples.
std::vector<std::string> drain(RecordedStreams& streams);

/// The message of an error that must be there.
template <typename T>
std::string message_of(const Result<T>& result) {
  return result ? std::string{"no error"} : result.error().message;
}

constexpr HostTime at_ms(std::int64_t ms) {
  return HostTime{std::chrono::milliseconds{ms}};
}

}  // namespace geoflow::drivers::tests
