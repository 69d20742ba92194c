#include "openni2/module/modes.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include <OniCEnums.h>
#include <OniCTypes.h>

#include "d435i/core/transport.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::openni2 {
namespace {

using d435i::PixelCoding;
using d435i::VideoStream;

constexpr int kUsualWidth = 640;
constexpr int kUsualHeight = 480;
constexpr int kUsualRate_hz = 30;

PixelCoding coding_of(VideoStream stream) {
  return stream == VideoStream::kDepth ? PixelCoding::kZ16 : PixelCoding::kYuyv;
}

}  // namespace

std::vector<OniVideoMode> oni_modes(const std::vector<d435i::VideoMode>& modes,
                                    VideoStream stream) {
  const std::vector<OniPixelFormat> formats =
      stream == VideoStream::kDepth
          ? std::vector{ONI_PIXEL_FORMAT_DEPTH_1_MM}
          : std::vector{ONI_PIXEL_FORMAT_RGB888, ONI_PIXEL_FORMAT_YUYV, ONI_PIXEL_FORMAT_GRAY8};
  std::vector<OniVideoMode> all;
  for (const OniPixelFormat format : formats) {
    for (const d435i::VideoMode& mode : modes) {
      if (mode.coding == coding_of(stream)) {
        all.push_back({.pixelFormat = format,
                       .resolutionX = mode.width,
                       .resolutionY = mode.height,
                       .fps = mode.rate_hz});
      }
    }
  }
  return all;
}

std::optional<OniVideoMode> default_mode(const std::vector<OniVideoMode>& modes) {
  if (modes.empty()) {
    return std::nullopt;
  }
  const auto usual = std::ranges::find_if(modes, [](const OniVideoMode& mode) {
    return mode.resolutionX == kUsualWidth && mode.resolutionY == kUsualHeight &&
           mode.fps == kUsualRate_hz;
  });
  return usual != modes.end() ? *usual : modes.front();
}

d435i::VideoMode camera_mode(const OniVideoMode& mode, VideoStream stream) {
  return {coding_of(stream), mode.resolutionX, mode.resolutionY, mode.fps};
}

bool equal(const OniVideoMode& a, const OniVideoMode& b) {
  return a.pixelFormat == b.pixelFormat && a.resolutionX == b.resolutionX &&
         a.resolutionY == b.resolutionY && a.fps == b.fps;
}

}  // namespace geoflow::drivers::openni2
