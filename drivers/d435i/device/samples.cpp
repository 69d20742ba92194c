#include "d435i/device/samples.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/merge.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/pixels/registration.hpp"
#include "d435i/pixels/yuyv.hpp"

namespace geoflow::drivers::d435i {
namespace {

// What the pipeline's queues may hold of both kinds, and what the estimator keeps.
constexpr std::size_t kPooledFrames = 48;
// More frames than this between two counters is a counter that began anew.
constexpr std::uint32_t kLargestGap = 1000;

constexpr StampInfo kImuStamps{
    .domain = StampDomain::kDevice, .wrap = kClockWrap, .on_camera_clock = true};

}  // namespace

SampleMaker::SampleMaker(DepthRegistration registration, const ImageShape& color,
                         const ImuTable& imu, const StampInfo& camera_stamps)
    : registration_{std::move(registration)},
      color_{color},
      depth_{.width = color.width, .height = color.height, .format = PixelFormat::kDepth16},
      imu_table_{imu},
      pool_{kPooledFrames},
      camera_{camera_stamps},
      imu_{kImuStamps} {}

std::uint64_t SampleMaker::stamped_by_arrival() const noexcept {
  std::uint64_t sum = 0;
  for (const StampSource& source : stamps_) {
    sum += source.by_arrival();
  }
  for (const StampSource& source : imu_stamps_) {
    sum += source.by_arrival();
  }
  return sum;
}

void SampleMaker::on_frame(const RawFrame& frame) {
  const auto device_us = read_header(frame);
  const auto t_us =
      stamps_.at(static_cast<std::size_t>(frame.stream)).stamp(device_us, frame.t_arrival);
  if (frame.stream == VideoStream::kDepth) {
    deliver_depth(frame, t_us);
  } else {
    deliver_color(frame, t_us);
  }
}

std::optional<std::uint32_t> SampleMaker::read_header(const RawFrame& frame) {
  const auto stamp = read_frame_stamp(frame.header);
  if (stamp && stamp->counter) {
    count_missed(frame.stream, *stamp->counter);
  }
  return stamp ? std::optional{stamp->t_us} : std::nullopt;
}

void SampleMaker::count_missed(VideoStream stream, std::uint32_t counter) noexcept {
  auto& last = counters_.at(static_cast<std::size_t>(stream));
  const std::uint32_t step = last ? counter - *last : 1;
  if (step > 1 && step <= kLargestGap) {
    missed_ += step - 1;
  }
  last = counter;
}

void SampleMaker::deliver_depth(const RawFrame& frame, std::uint32_t t_us) {
  FrameRef image = pool_.acquire(depth_);
  if (!image) {
    camera_.count_dropped();
    return;
  }
  void* const pixels = image.writable_bytes().data();
  const std::span target{static_cast<std::uint16_t*>(pixels),
                         image.writable_bytes().size() / sizeof(std::uint16_t)};
  if (const auto done = registration_.run(frame.pixels, target); !done) {
    camera_.count_rejected(done.error().message);
    return;
  }
  const Arrival<CameraClock, DepthFrame> arrival{.t_device = device_time<CameraClock>(t_us),
                                                 .t_arrival = frame.t_arrival,
                                                 .sample = {.image = std::move(image)}};
  camera_.deliver([&](CameraSink& sink) { sink.on_depth(arrival); });
}

void SampleMaker::deliver_color(const RawFrame& frame, std::uint32_t t_us) {
  FrameRef image = pool_.acquire(color_);
  if (!image) {
    camera_.count_dropped();
    return;
  }
  if (const auto done = convert_yuyv(frame.pixels, color_, image.writable_bytes()); !done) {
    camera_.count_rejected(done.error().message);
    return;
  }
  const Arrival<CameraClock, ColorFrame> arrival{.t_device = device_time<CameraClock>(t_us),
                                                 .t_arrival = frame.t_arrival,
                                                 .sample = {.image = std::move(image)}};
  camera_.deliver([&](CameraSink& sink) { sink.on_color(arrival); });
}

void SampleMaker::on_imu(const RawImu& imu) {
  const bool is_accel = imu.reading.sensor == ImuSensor::kAccelerometer;
  const auto device_us = imu.device_stamped ? std::optional{imu.reading.t_device_us} : std::nullopt;
  StampedVector stamped{.t_us = imu_stamps_.at(is_accel ? 0 : 1).stamp(device_us, imu.t_arrival),
                        .t_arrival = imu.t_arrival,
                        .value = to_si(imu.reading)};
  if (is_accel) {
    stamped.value = imu_table_.accel_scale * stamped.value - imu_table_.accel_bias_mps2;
    merge_.add_accel(stamped);
  } else {
    stamped.value = imu_table_.gyro_scale * stamped.value - imu_table_.gyro_bias_radps;
    merge_.add_gyro(stamped);
  }
  while (const auto sample = merge_.pop()) {
    imu_.deliver([&](ImuSink& sink) { sink.on_imu(*sample); });
  }
}

void SampleMaker::on_damaged_frame(VideoStream stream, std::string_view why) {
  camera_.count_rejected(std::string{name_of(stream)}.append(": ").append(why));
}

void SampleMaker::on_damaged_imu(std::string_view why) {
  imu_.count_rejected(std::string{why});
}

}  // namespace geoflow::drivers::d435i
