#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Driver/OniDriverAPI.h>
#include <OniCTypes.h>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/core/camera_facts.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/pixels/registration.hpp"
#include "openni2/module/camera_feed.hpp"

namespace geoflow::drivers::openni2 {

/// What the streams of one device share. Thread-safe.
struct DeviceState {
  std::atomic<bool> registered{false};           ///< depth as the colour camera sees it
  std::atomic<std::uint64_t> first_frame_us{0};  ///< from which frames are numbered; 0: none yet
};

/// Depth or colour of a camera as an OpenNI stream. OpenNI calls its functions one at a time;
/// frames go out on the feed's thread.
class Stream final : public oni::driver::StreamBase {
 public:
  /// `feed` and `state` must outlive it.
  Stream(CameraFeed& feed, DeviceState& state, d435i::VideoStream kind, const OniVideoMode& mode,
         std::vector<OniVideoMode> modes);
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() override;

  OniStatus start() override;
  void stop() override;
  OniStatus getProperty(int property, void* data, int* size) override;
  OniStatus setProperty(int property, const void* data, int size) override;
  OniBool isPropertySupported(int property) override;
  int getRequiredFrameSize() override;
  OniStatus convertDepthToColorCoordinates(oni::driver::StreamBase* color, int x, int y,
                                           OniDepthPixel z, int* color_x, int* color_y) override;

 private:
  [[nodiscard]] Result<d435i::CameraFacts> facts(const OniVideoMode& color) const;
  [[nodiscard]] Result<CameraIntrinsics> intrinsics() const;
  [[nodiscard]] OniStatus give_field_of_view(bool horizontal, void* data, int* size) const;
  [[nodiscard]] ImageShape shape() const;
  void deliver(const d435i::RawFrame& raw, std::uint64_t t_us);
  [[nodiscard]] Result<void> fill(std::span<const std::byte> raw, std::span<std::byte> target);
  [[nodiscard]] Result<void> fill_depth(std::span<const std::byte> raw,
                                        std::span<std::byte> target);
  [[nodiscard]] int number(std::uint64_t t_us);

  CameraFeed& feed_;
  DeviceState& state_;
  const d435i::VideoStream kind_;
  const std::vector<OniVideoMode> modes_;
  OniVideoMode mode_;
  bool started_ = false;
  std::optional<d435i::DepthRegistration> registration_{};  // the feed's thread, while started
};

}  // namespace geoflow::drivers::openni2
