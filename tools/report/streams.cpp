#include "report/streams.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {
namespace {

constexpr double kMillisecondsPerSecond = 1e3;
constexpr double kGap = 1.5;  ///< of the median

/// Takes the stamps of all that a recording delivers.
class StampTaker final : public CameraSink, public ImuSink, public LegSink {
 public:
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override { take(0, frame); }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override { take(1, frame); }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override { take(2, sample); }
  void on_legs(const Arrival<LegClock, LegSample>& sample) override { take(3, sample); }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override {
    take(4, sample);
  }

  [[nodiscard]] std::vector<StreamTimes> streams() const {
    constexpr std::array kNames{"color", "depth", "imu", "legs", "body_velocity"};
    std::vector<StreamTimes> streams;
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      if (stamps_[i].empty()) {
        continue;
      }
      StreamTimes stream{.name = kNames[i], .t_s = {}};
      stream.t_s.reserve(stamps_[i].size());
      for (const Duration stamp : stamps_[i]) {
        stream.t_s.push_back(to_seconds(stamp - stamps_[i].front()));
      }
      streams.push_back(std::move(stream));
    }
    return streams;
  }

 private:
  template <typename Sample>
  void take(std::size_t stream, const Sample& sample) {
    stamps_.at(stream).push_back(sample.t_device.time_since_epoch());
  }

  static constexpr std::size_t kStreams = 5;
  std::array<std::vector<Duration>, kStreams> stamps_;
};

Result<void> start(drivers::RecordedStreams& streams, StampTaker& taker) {
  return streams.camera()
      .start(taker)
      .and_then(
          [&] { return streams.imu() != nullptr ? streams.imu()->start(taker) : Result<void>{}; })
      .and_then([&] {
        return streams.legs() != nullptr ? streams.legs()->start(taker) : Result<void>{};
      });
}

std::vector<double> intervals_ms(const StreamTimes& stream) {
  std::vector<double> intervals;
  intervals.reserve(stream.t_s.size());
  for (std::size_t i = 1; i < stream.t_s.size(); ++i) {
    intervals.push_back(kMillisecondsPerSecond * (stream.t_s[i] - stream.t_s[i - 1]));
  }
  return intervals;
}

}  // namespace

Result<RecordingTimes> read_times(const std::filesystem::path& recording,
                                  const std::filesystem::path& calibration,
                                  const ReadingProgress& progress) {
  drivers::RecordingOptions options{.path = recording, .color_as_gray = true};
  if (!calibration.empty()) {
    options.calibration = calibration;
  }
  const auto opened = drivers::RecordedStreams::open(options);
  if (!opened) {
    return tl::unexpected{opened.error()};
  }
  drivers::RecordedStreams& streams = **opened;
  StampTaker taker;
  if (auto started = start(streams, taker); !started) {
    return tl::unexpected{std::move(started.error())};
  }
  RecordingTimes times;
  for (std::uint64_t samples = 1;; ++samples) {
    const auto more = streams.step();
    times.rejected += more ? 0U : 1U;
    if (more && !*more) {
      break;
    }
    if (!progress(samples)) {
      times.interrupted = true;
      break;
    }
  }
  times.streams = taker.streams();
  return times;
}

StreamGaps find_gaps(const StreamTimes& stream) {
  const std::vector<double> intervals = intervals_ms(stream);
  if (intervals.empty()) {
    return {};
  }
  std::vector<double> sorted = intervals;
  std::ranges::sort(sorted);
  StreamGaps found{.median_ms = sorted[sorted.size() / 2], .longest_ms = sorted.back()};
  for (const double interval : intervals) {
    if (found.median_ms > 0 && interval > kGap * found.median_ms) {
      ++found.gaps;
      found.missing += static_cast<std::uint64_t>(std::llround(interval / found.median_ms)) - 1;
    }
  }
  return found;
}

Figure interval_figure(const RecordingTimes& times) {
  constexpr int kHeightPx = 420;
  Figure figure{.title = "Time between samples",
                .subtitle = "by the device's clock, at the time of the later sample",
                .columns = std::max(1, std::min(3, static_cast<int>(times.streams.size()))),
                .height_px = kHeightPx};
  if (times.streams.size() > 3) {
    figure.height_px *= 2;
  }
  for (const StreamTimes& stream : times.streams) {
    Series series{.label = "", .x = stream.t_s, .y = intervals_ms(stream)};
    series.x.erase(series.x.begin());
    figure.axes.push_back({.title = stream.name,
                           .x_label = "time since the stream's first sample (s)",
                           .y_label = "interval (ms)",
                           .y_from_zero = true,
                           .series = {std::move(series)}});
  }
  return figure;
}

}  // namespace geoflow::tools
