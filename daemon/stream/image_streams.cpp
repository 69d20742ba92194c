#include "stream/image_streams.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/log.hpp"

#include "stream/frame_ring.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::uint32_t kSlots = 8;  // a reader has a quarter of a second at 30 Hz

/// 0: none.
std::uint32_t format_number(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGray8:
      return GEOFLOW_GRAY8;
    case PixelFormat::kDepth16:
      return GEOFLOW_DEPTH16;
    case PixelFormat::kRgb8:
    case PixelFormat::kBgr8:
    case PixelFormat::kYuyv:
      break;
  }
  return 0;
}

std::uint32_t distortion_number(DistortionModel model) {
  switch (model) {
    case DistortionModel::kNone:
      return GEOFLOW_UNDISTORTED;
    case DistortionModel::kRadtan:
      return GEOFLOW_RADTAN;
    case DistortionModel::kEquidistant:
      return GEOFLOW_EQUIDISTANT;
  }
  return GEOFLOW_UNDISTORTED;
}

geoflow_ring describe(const FrameRing& ring, geoflow_stream stream, std::uint64_t number,
                      const Calibration& calibration) {
  const CameraIntrinsics& camera = calibration.camera;
  geoflow_ring record{.ring = number,
                      .bytes = ring.bytes(),
                      .slot_bytes = ring.slot_bytes(),
                      .stream = static_cast<std::uint32_t>(stream),
                      .slots = ring.slots(),
                      .distortion_model = distortion_number(camera.model),
                      .reserved = 0,
                      .intrinsics = {camera.fx, camera.fy, camera.cx, camera.cy},
                      .distortion = {},
                      .unit_m = stream == GEOFLOW_DEPTH ? calibration.depth_unit_m : 0};
  std::ranges::copy(camera.distortion, &record.distortion[0]);
  return record;
}

}  // namespace

std::vector<StreamedFrame> ImageStreams::publish(const Images& images,
                                                 const Calibration& calibration,
                                                 std::uint32_t want) {
  std::vector<StreamedFrame> frames;
  if ((want & GEOFLOW_WANT_COLOR) != 0) {
    add(color_, images.color, calibration, frames);
  }
  if ((want & GEOFLOW_WANT_DEPTH) != 0) {
    add(depth_, images.depth, calibration, frames);
  }
  for (StreamedFrame& streamed : frames) {
    const std::int64_t offset_ns =
        streamed.frame.stream == GEOFLOW_DEPTH ? images.depth_offset.count() : 0;
    streamed.frame.t_capture_ns = images.t_capture_ns + offset_ns;
    streamed.frame.t_recording_ns = images.t_recording_ns + offset_ns;
    streamed.frame.frame = images.frame;
  }
  return frames;
}

void ImageStreams::add(Stream& stream, const FrameRef& image, const Calibration& calibration,
                       std::vector<StreamedFrame>& frames) {
  if (!image || format_number(image.shape().format) == 0 ||
      !make_room(stream, image.shape().size_bytes())) {
    return;
  }
  const std::span<const std::byte> bytes = image.bytes();
  const ImageShape& shape = image.shape();
  const FrameRing::Place place = stream.ring->write(bytes);
  frames.push_back({.ring = describe(*stream.ring, stream.id, stream.number, calibration),
                    .fd = stream.ring->fd(),
                    .frame = {.t_capture_ns = 0,
                              .t_recording_ns = 0,
                              .frame = 0,
                              .ring = stream.number,
                              .generation = place.generation,
                              .bytes = bytes.size(),
                              .stream = static_cast<std::uint32_t>(stream.id),
                              .slot = place.slot,
                              .format = format_number(shape.format),
                              .width = static_cast<std::uint32_t>(shape.width),
                              .height = static_cast<std::uint32_t>(shape.height),
                              .stride = static_cast<std::uint32_t>(shape.row_bytes())}});
}

bool ImageStreams::make_room(Stream& stream, std::size_t bytes) {
  if (stream.ring && bytes <= stream.ring->frame_bytes()) {
    return true;
  }
  auto ring = FrameRing::create(stream.id == GEOFLOW_COLOR ? "geoflow colour" : "geoflow depth",
                                kSlots, bytes);
  if (!ring) {
    if (!std::exchange(said_, true)) {
      log::error("stream", "no memory for images that clients want: {}", ring.error().message);
    }
    return false;
  }
  stream.ring.emplace(std::move(*ring));
  stream.number = ++rings_;
  return true;
}

}  // namespace geoflow::daemon
