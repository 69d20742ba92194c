#include "stream/frame_streams.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/log.hpp"

#include "map/map_cloud.hpp"
#include "stream/frame_ring.hpp"

namespace geoflow::daemon {
namespace {

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

geoflow_ring describe(const FrameRing& ring, geoflow_stream stream, std::uint64_t number) {
  geoflow_ring record{};
  record.ring = number;
  record.bytes = ring.bytes();
  record.slot_bytes = ring.slot_bytes();
  record.stream = static_cast<std::uint32_t>(stream);
  record.slots = ring.slots();
  return record;
}

void describe_camera(const Calibration& calibration, geoflow_ring& record) {
  const CameraIntrinsics& camera = calibration.camera;
  record.distortion_model = distortion_number(camera.model);
  std::ranges::copy(std::array{camera.fx, camera.fy, camera.cx, camera.cy}, &record.intrinsics[0]);
  std::ranges::copy(camera.distortion, &record.distortion[0]);
  record.unit_m = record.stream == GEOFLOW_DEPTH ? calibration.depth_unit_m : 0;
}

}  // namespace

std::vector<StreamedFrame> FrameStreams::publish(const Images& images,
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

void FrameStreams::add(Stream& stream, const FrameRef& image, const Calibration& calibration,
                       std::vector<StreamedFrame>& frames) {
  if (!image || format_number(image.shape().format) == 0) {
    return;
  }
  const ImageShape& shape = image.shape();
  if (auto streamed = write(stream, image.bytes(), shape.size_bytes())) {
    describe_camera(calibration, streamed->ring);
    streamed->frame.format = format_number(shape.format);
    streamed->frame.width = static_cast<std::uint32_t>(shape.width);
    streamed->frame.height = static_cast<std::uint32_t>(shape.height);
    streamed->frame.stride = static_cast<std::uint32_t>(shape.row_bytes());
    frames.push_back(*streamed);
  }
}

std::optional<StreamedFrame> FrameStreams::publish(const MapCloud& cloud) {
  auto streamed =
      write(cloud_, std::as_bytes(std::span{cloud}), kMostCloudPoints * sizeof(geoflow_point));
  if (streamed) {
    streamed->frame.frame = clouds_++;
    streamed->frame.format = GEOFLOW_POINTS;
    streamed->frame.width = static_cast<std::uint32_t>(cloud.size());
    streamed->frame.height = 1;
    streamed->frame.stride = sizeof(geoflow_point);
  }
  return streamed;
}

std::optional<StreamedFrame> FrameStreams::write(Stream& stream, std::span<const std::byte> bytes,
                                                 std::size_t room) {
  FrameRing* const ring = ring_for(stream, room);
  if (ring == nullptr) {
    return std::nullopt;
  }
  const FrameRing::Place place = ring->write(bytes);
  StreamedFrame streamed{.ring = describe(*ring, stream.id, stream.number), .fd = ring->fd()};
  streamed.frame.ring = stream.number;
  streamed.frame.generation = place.generation;
  streamed.frame.bytes = bytes.size();
  streamed.frame.stream = static_cast<std::uint32_t>(stream.id);
  streamed.frame.slot = place.slot;
  return streamed;
}

FrameRing* FrameStreams::ring_for(Stream& stream, std::size_t bytes) {
  if (stream.ring && bytes <= stream.ring->frame_bytes()) {
    return &*stream.ring;
  }
  auto ring = FrameRing::create(stream.name, stream.slots, bytes);
  if (!ring) {
    if (!std::exchange(said_, true)) {
      log::error("stream", "no memory for frames that clients want: {}", ring.error().message);
    }
    return nullptr;
  }
  stream.number = ++rings_;
  return &stream.ring.emplace(std::move(*ring));
}

}  // namespace geoflow::daemon
