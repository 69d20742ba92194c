#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"

#include "d435i/core/stamps.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/merge.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/pixels/registration.hpp"
#include "port.hpp"

namespace geoflow::drivers::d435i {

/// Makes samples of what a transport brings, and delivers them to the ports. Thread-bound.
class SampleMaker final : public TransportSink {
 public:
  SampleMaker(DepthRegistration registration, const ImageShape& color, const ImuTable& imu,
              const StampInfo& camera_stamps);

  void on_frame(const RawFrame& frame) override;
  void on_imu(const RawImu& imu) override;
  void on_damaged_frame(VideoStream stream, std::string_view why) override;
  void on_damaged_imu(std::string_view why) override;

  [[nodiscard]] Port<CameraSink>& camera() noexcept { return camera_; }
  [[nodiscard]] Port<ImuSink>& imu() noexcept { return imu_; }

  [[nodiscard]] std::uint64_t missed_frames() const noexcept { return missed_; }
  [[nodiscard]] std::uint64_t imu_unpaired() const noexcept { return merge_.lost(); }
  [[nodiscard]] std::uint64_t stamped_by_arrival() const noexcept;
  /// The camera was away: its counters begin anew.
  void forget_counters() noexcept { counters_ = {}; }

 private:
  void deliver_depth(const RawFrame& frame, std::uint32_t t_us);
  void deliver_color(const RawFrame& frame, std::uint32_t t_us);
  /// The middle of the exposure, where the header tells it; none where it tells nothing.
  [[nodiscard]] std::optional<std::uint32_t> read_header(const RawFrame& frame);
  void count_missed(VideoStream stream, std::uint32_t counter) noexcept;

  DepthRegistration registration_;
  ImageShape color_;
  ImageShape depth_;
  ImuTable imu_table_;
  FramePool pool_;
  std::array<StampSource, kVideoStreams> stamps_{};
  std::array<StampSource, 2> imu_stamps_{};
  std::array<std::optional<std::uint32_t>, kVideoStreams> counters_{};
  std::uint64_t missed_ = 0;
  ImuMerge merge_;
  Port<CameraSink> camera_;
  Port<ImuSink> imu_;
};

}  // namespace geoflow::drivers::d435i
