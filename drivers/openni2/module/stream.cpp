#include "openni2/module/stream.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <Driver/OniDriverAPI.h>
#include <OniCEnums.h>
#include <OniCProperties.h>
#include <OniCTypes.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/core/camera_facts.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/pixels/registration.hpp"
#include "d435i/pixels/yuyv.hpp"
#include "openni2/module/camera_feed.hpp"
#include "openni2/module/modes.hpp"
#include "openni2/module/properties.hpp"

namespace geoflow::drivers::openni2 {
namespace {

using d435i::RawFrame;
using d435i::VideoStream;

// OpenNI's own largest depth [mm] (openni::VideoStream's users size their histograms by it), and
// more than a D435i measures. What is not below is no measurement: OpenNI's codec has no room for
// it.
constexpr int kLargestDepth_mm = 10'000;
constexpr int kSmallestDepth_mm = 0;
constexpr double kMillimetre_m = 1e-3;
constexpr double kMicrosecondsPerSecond = 1e6;

/// Depth counts to millimetres in place.
void to_millimetres(std::span<std::uint16_t> depth, double unit_m) {
  const double scale = unit_m / kMillimetre_m;
  for (std::uint16_t& pixel : depth) {
    const auto depth_mm = static_cast<int>(std::lround(pixel * scale));
    pixel = depth_mm < kLargestDepth_mm ? static_cast<std::uint16_t>(depth_mm) : std::uint16_t{0};
  }
}

std::span<std::uint16_t> as_depth(std::span<std::byte> bytes) {
  void* const first = bytes.data();
  return {static_cast<std::uint16_t*>(first), bytes.size() / sizeof(std::uint16_t)};
}

}  // namespace

Stream::Stream(CameraFeed& feed, DeviceState& state, VideoStream kind, const OniVideoMode& mode,
               std::vector<OniVideoMode> modes)
    : feed_{feed}, state_{state}, kind_{kind}, modes_{std::move(modes)}, mode_{mode} {}

Stream::~Stream() {
  feed_.stop(kind_);
}

OniStatus Stream::start() {
  if (kind_ == VideoStream::kDepth) {
    // As the colour camera would see it at depth's own size: OpenNI keeps the size.
    auto made = facts(mode_).and_then([](const d435i::CameraFacts& its) {
      return d435i::DepthRegistration::create(its.geometry);
    });
    if (!made) {
      log::error("openni2", "{}", made.error().message);
      return ONI_STATUS_ERROR;
    }
    registration_ = std::move(*made);
  }
  const auto started =
      feed_.start(kind_, camera_mode(mode_, kind_),
                  [this](const RawFrame& raw, std::uint64_t t_us) { deliver(raw, t_us); });
  if (!started) {
    log::error("openni2", "{}", started.error().message);
    return ONI_STATUS_ERROR;
  }
  started_ = true;
  return ONI_STATUS_OK;
}

void Stream::stop() {
  feed_.stop(kind_);
  started_ = false;
}

OniStatus Stream::getProperty(int property, void* data, int* size) {
  switch (property) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
      return give(mode_, data, size);
    case ONI_STREAM_PROPERTY_CROPPING:
      return give(OniCropping{.enabled = FALSE,
                              .originX = 0,
                              .originY = 0,
                              .width = mode_.resolutionX,
                              .height = mode_.resolutionY},
                  data, size);
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
      return give_field_of_view(true, data, size);
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
      return give_field_of_view(false, data, size);
    case ONI_STREAM_PROPERTY_MAX_VALUE:
      return kind_ == VideoStream::kDepth ? give(kLargestDepth_mm, data, size)
                                          : ONI_STATUS_NOT_SUPPORTED;
    case ONI_STREAM_PROPERTY_MIN_VALUE:
      return kind_ == VideoStream::kDepth ? give(kSmallestDepth_mm, data, size)
                                          : ONI_STATUS_NOT_SUPPORTED;
    case ONI_STREAM_PROPERTY_STRIDE:
      return give(static_cast<int>(shape().row_bytes()), data, size);
    case ONI_STREAM_PROPERTY_MIRRORING:
      return give(OniBool{FALSE}, data, size);
    default:
      return ONI_STATUS_NOT_SUPPORTED;
  }
}

OniStatus Stream::setProperty(int property, const void* data, int size) {
  if (property == ONI_STREAM_PROPERTY_VIDEO_MODE) {
    const auto mode = take<OniVideoMode>(data, size);
    const bool known = mode && std::ranges::any_of(modes_, [&](const OniVideoMode& one) {
                         return equal(one, *mode);
                       });
    if (!known) {
      return ONI_STATUS_BAD_PARAMETER;
    }
    if (started_) {
      return ONI_STATUS_OUT_OF_FLOW;
    }
    mode_ = *mode;
    return ONI_STATUS_OK;
  }
  if (property == ONI_STREAM_PROPERTY_MIRRORING) {
    const auto mirrored = take<OniBool>(data, size);
    return mirrored && *mirrored == FALSE ? ONI_STATUS_OK : ONI_STATUS_NOT_SUPPORTED;
  }
  return ONI_STATUS_NOT_SUPPORTED;
}

OniBool Stream::isPropertySupported(int property) {
  switch (property) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
    case ONI_STREAM_PROPERTY_CROPPING:
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
    case ONI_STREAM_PROPERTY_STRIDE:
    case ONI_STREAM_PROPERTY_MIRRORING:
      return TRUE;
    case ONI_STREAM_PROPERTY_MAX_VALUE:
    case ONI_STREAM_PROPERTY_MIN_VALUE:
      return kind_ == VideoStream::kDepth ? TRUE : FALSE;
    default:
      return FALSE;
  }
}

int Stream::getRequiredFrameSize() {
  return static_cast<int>(shape().size_bytes());
}

OniStatus Stream::convertDepthToColorCoordinates(oni::driver::StreamBase* color, int x, int y,
                                                 OniDepthPixel z, int* color_x, int* color_y) {
  const auto* const other = dynamic_cast<const Stream*>(color);
  if (other == nullptr || z == 0) {
    return ONI_STATUS_BAD_PARAMETER;
  }
  if (state_.registered) {
    *color_x = x * other->mode_.resolutionX / mode_.resolutionX;
    *color_y = y * other->mode_.resolutionY / mode_.resolutionY;
    return ONI_STATUS_OK;
  }
  const auto its = facts(other->mode_);
  if (!its) {
    return ONI_STATUS_ERROR;
  }
  const auto& [depth_camera, color_camera, T_cam_depth, unit_m] = its->geometry;
  const Vector3d p_depth = kMillimetre_m * z *
                           Vector3d{(x - depth_camera.cx) / depth_camera.fx,
                                    (y - depth_camera.cy) / depth_camera.fy, 1.0};
  const Vector3d p_cam = T_cam_depth * p_depth;
  if (p_cam.z() <= 0) {
    return ONI_STATUS_BAD_PARAMETER;
  }
  *color_x =
      static_cast<int>(std::lround(color_camera.fx * p_cam.x() / p_cam.z() + color_camera.cx));
  *color_y =
      static_cast<int>(std::lround(color_camera.fy * p_cam.y() / p_cam.z() + color_camera.cy));
  return ONI_STATUS_OK;
}

Result<d435i::CameraFacts> Stream::facts(const OniVideoMode& color) const {
  return d435i::facts_of(feed_.tables(), camera_mode(mode_, VideoStream::kDepth),
                         camera_mode(color, VideoStream::kColor));
}

Result<CameraIntrinsics> Stream::intrinsics() const {
  const bool as_color = kind_ == VideoStream::kColor || state_.registered;
  return facts(mode_).map([&](const d435i::CameraFacts& its) {
    return as_color ? its.geometry.color : its.geometry.depth;
  });
}

OniStatus Stream::give_field_of_view(bool horizontal, void* data, int* size) const {
  const auto camera = intrinsics();
  if (!camera) {
    return ONI_STATUS_ERROR;
  }
  const double half =
      horizontal ? camera->width / (2 * camera->fx) : camera->height / (2 * camera->fy);
  return give(static_cast<float>(2 * std::atan(half)), data, size);
}

ImageShape Stream::shape() const {
  ImageShape shape{.width = mode_.resolutionX, .height = mode_.resolutionY};
  switch (mode_.pixelFormat) {
    case ONI_PIXEL_FORMAT_RGB888:
      shape.format = PixelFormat::kRgb8;
      break;
    case ONI_PIXEL_FORMAT_YUYV:
      shape.format = PixelFormat::kYuyv;
      break;
    case ONI_PIXEL_FORMAT_GRAY8:
      shape.format = PixelFormat::kGray8;
      break;
    default:
      shape.format = PixelFormat::kDepth16;
  }
  return shape;
}

void Stream::deliver(const RawFrame& raw, std::uint64_t t_us) {
  OniFrame* const frame = getServices().acquireFrame();
  if (frame == nullptr) {
    return;
  }
  const ImageShape its = shape();
  const std::size_t bytes = its.size_bytes();
  const std::span target{static_cast<std::byte*>(frame->data), bytes};
  const auto filled = frame->dataSize >= static_cast<int>(bytes)
                          ? fill(raw.pixels, target)
                          : fail(ErrorCode::kSystem, "OpenNI gave a buffer of {} bytes for {}",
                                 frame->dataSize, bytes);
  if (filled) {
    frame->dataSize = static_cast<int>(bytes);
    frame->sensorType = kind_ == VideoStream::kDepth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR;
    frame->timestamp = t_us;
    frame->frameIndex = number(t_us);
    frame->width = its.width;
    frame->height = its.height;
    frame->videoMode = mode_;
    frame->croppingEnabled = FALSE;
    frame->cropOriginX = 0;
    frame->cropOriginY = 0;
    frame->stride = static_cast<int>(its.row_bytes());
    raiseNewFrame(frame);
  } else {
    log::warning("openni2", "{}: {}", d435i::name_of(kind_), filled.error().message);
  }
  getServices().releaseFrame(frame);
}

Result<void> Stream::fill(std::span<const std::byte> raw, std::span<std::byte> target) {
  if (kind_ == VideoStream::kDepth) {
    return fill_depth(raw, target);
  }
  if (mode_.pixelFormat != ONI_PIXEL_FORMAT_YUYV) {
    return d435i::convert_yuyv(raw, shape(), target);
  }
  if (raw.size() != target.size()) {
    return fail(ErrorCode::kInvalidData, "{} bytes where a frame has {}", raw.size(),
                target.size());
  }
  std::ranges::copy(raw, target.begin());
  return {};
}

Result<void> Stream::fill_depth(std::span<const std::byte> raw, std::span<std::byte> target) {
  if (raw.size() != target.size()) {
    return fail(ErrorCode::kInvalidData, "{} bytes where a frame has {}", raw.size(),
                target.size());
  }
  if (registration_ && state_.registered) {
    if (auto done = registration_->run(raw, as_depth(target)); !done) {
      return done;
    }
  } else {
    std::ranges::copy(raw, target.begin());
  }
  to_millimetres(as_depth(target), feed_.tables().depth_unit_m);
  return {};
}

/// Frames of both streams that were taken together get one number, by which OpenNI pairs them.
int Stream::number(std::uint64_t t_us) {
  std::uint64_t first_us = 0;
  if (state_.first_frame_us.compare_exchange_strong(first_us, t_us)) {
    first_us = t_us;
  }
  const auto since_us = static_cast<double>(static_cast<std::int64_t>(t_us - first_us));
  return 1 + static_cast<int>(std::lround(since_us * mode_.fps / kMicrosecondsPerSecond));
}

}  // namespace geoflow::drivers::openni2
