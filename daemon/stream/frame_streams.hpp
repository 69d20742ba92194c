#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/time.hpp"

#include "map/map_cloud.hpp"
#include "stream/frame_ring.hpp"

namespace geoflow::daemon {

/// The images of one frame that the estimator has worked on.
struct Images {
  FrameRef color{};               ///< empty: there was none
  FrameRef depth{};               ///< likewise
  Duration depth_offset{};        ///< its capture minus that of colour
  std::int64_t t_capture_ns = 0;  ///< as in geoflow_pose
  std::int64_t t_recording_ns = 0;
  std::uint64_t frame = 0;
};

/// A frame in memory that clients share, with what they must be told of both.
struct StreamedFrame {
  geoflow_ring ring{};
  int fd = -1;  ///< of the ring, whose it is: an image's until the next image, the cloud's for good
  geoflow_frame frame{};
};

/// The bit of geoflow_want that asks for a stream (geoflow_stream).
[[nodiscard]] constexpr std::uint32_t want_of(std::uint32_t stream) noexcept {
  return std::uint32_t{2} << stream;
}
static_assert(want_of(GEOFLOW_COLOR) == GEOFLOW_WANT_COLOR);
static_assert(want_of(GEOFLOW_DEPTH) == GEOFLOW_WANT_DEPTH);
static_assert(want_of(GEOFLOW_CLOUD) == GEOFLOW_WANT_CLOUD);

/// Images and clouds for clients: one ring a stream, which is made when its first frame is wanted,
/// and anew for a larger image. It is kept from then on: clients can hold memory that they were
/// given, so one that comes and goes again and again must not be given other memory each time.
/// Thread-compatible.
class FrameStreams {
 public:
  /// Copies those images that are wanted (geoflow_want, or-ed) into their rings; images that are
  /// not there, or of a format without a number in the protocol, are left out. Where the system
  /// gives no memory, that is logged once, and there are none.
  [[nodiscard]] std::vector<StreamedFrame> publish(const Images& images,
                                                   const Calibration& calibration,
                                                   std::uint32_t want);
  /// Likewise the map's surfaces; nothing where there is no memory.
  [[nodiscard]] std::optional<StreamedFrame> publish(const MapCloud& cloud);

 private:
  struct Stream {
    geoflow_stream id;
    const char* name;
    std::uint32_t slots;
    std::optional<FrameRing> ring{};
    std::uint64_t number = 0;  // of the ring
  };
  void add(Stream& stream, const FrameRef& image, const Calibration& calibration,
           std::vector<StreamedFrame>& frames);
  /// A frame in its stream's next slot, with what is alike for images and clouds. `room`: bytes
  /// that a ring that must be made has room for.
  [[nodiscard]] std::optional<StreamedFrame> write(Stream& stream, std::span<const std::byte> bytes,
                                                   std::size_t room);
  /// With room for so many bytes; null where there is no memory.
  [[nodiscard]] FrameRing* ring_for(Stream& stream, std::size_t bytes);

  // A reader has a quarter of a second for an image, and ten for a cloud.
  Stream color_{.id = GEOFLOW_COLOR, .name = "geoflow colour", .slots = 8};
  Stream depth_{.id = GEOFLOW_DEPTH, .name = "geoflow depth", .slots = 8};
  Stream cloud_{.id = GEOFLOW_CLOUD, .name = "geoflow cloud", .slots = 2};
  std::uint64_t clouds_ = 0;
  std::uint64_t rings_ = 0;
  bool said_ = false;
};

}  // namespace geoflow::daemon
