#include "v4l2/video_device.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <linux/uvcvideo.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::drivers::v4l2 {
namespace {

/// More of anything than a node enumerates.
constexpr std::uint32_t kMostListed = 256;

ErrorCode code_of(int number) noexcept {
  switch (number) {
    case ENODEV:
    case ENOENT:
    case ENXIO:
      return ErrorCode::kNotFound;
    case EBUSY:
    case EPIPE:
    case EAGAIN:
    case ETIMEDOUT:
    case EIO:  // what uvcvideo makes of a camera that answers a control with nothing
      return ErrorCode::kUnavailable;
    default:
      return ErrorCode::kSystem;
  }
}

}  // namespace

void VideoDevice::Unmap::operator()(std::byte* memory) const noexcept {
  ::munmap(memory, size);
}

Result<VideoDevice> VideoDevice::open(const std::filesystem::path& path) {
  UniqueFd fd{::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)};
  if (!fd) {
    return fail(code_of(errno), "{}: {}", path.string(), std::system_category().message(errno));
  }
  VideoDevice device{std::move(fd), path.string(), false};
  v4l2_capability capability{};
  if (device.ioctl(VIDIOC_QUERYCAP, &capability) != 0) {
    return device.error("its capabilities cannot be asked");
  }
  device.metadata_ = (capability.device_caps & V4L2_CAP_META_CAPTURE) != 0;
  if (!device.metadata_ && (capability.device_caps & V4L2_CAP_VIDEO_CAPTURE) == 0) {
    return fail(ErrorCode::kUnsupported, "{}: captures neither video nor metadata", path.string());
  }
  return device;
}

int VideoDevice::ioctl(unsigned long request, void* argument) const noexcept {
  int done = 0;
  do {
    done = ::ioctl(fd_.get(), request, argument);
  } while (done != 0 && errno == EINTR);
  return done;
}

tl::unexpected<Error> VideoDevice::error(const char* what) const {
  const int number = errno;
  return fail(code_of(number), "{}: {}: {}", name_, what, std::system_category().message(number));
}

std::uint32_t VideoDevice::buffer_type() const noexcept {
  return metadata_ ? V4L2_BUF_TYPE_META_CAPTURE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

bool VideoDevice::has_format(std::uint32_t code) const {
  for (std::uint32_t i = 0; i < kMostListed; ++i) {
    v4l2_fmtdesc format{};
    format.index = i;
    format.type = buffer_type();
    if (ioctl(VIDIOC_ENUM_FMT, &format) != 0) {
      return false;
    }
    if (format.pixelformat == code) {
      return true;
    }
  }
  return false;
}

std::vector<NodeMode> VideoDevice::modes(std::uint32_t code) const {
  std::vector<NodeMode> all;
  for (std::uint32_t i = 0; i < kMostListed; ++i) {
    v4l2_frmsizeenum size{};
    size.index = i;
    size.pixel_format = code;
    if (ioctl(VIDIOC_ENUM_FRAMESIZES, &size) != 0 || size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      break;
    }
    for (std::uint32_t j = 0; j < kMostListed; ++j) {
      v4l2_frmivalenum interval{};
      interval.index = j;
      interval.pixel_format = code;
      interval.width = size.discrete.width;
      interval.height = size.discrete.height;
      if (ioctl(VIDIOC_ENUM_FRAMEINTERVALS, &interval) != 0 ||
          interval.type != V4L2_FRMIVAL_TYPE_DISCRETE || interval.discrete.numerator == 0) {
        break;
      }
      const v4l2_fract& time = interval.discrete;
      all.push_back(
          {.width = static_cast<int>(size.discrete.width),
           .height = static_cast<int>(size.discrete.height),
           .rate_hz = static_cast<int>((time.denominator + time.numerator / 2) / time.numerator)});
    }
  }
  return all;
}

Result<void> VideoDevice::set_video_format(std::uint32_t code, const NodeMode& mode) {
  v4l2_format format{};
  format.type = buffer_type();
  format.fmt.pix.width = static_cast<std::uint32_t>(mode.width);
  format.fmt.pix.height = static_cast<std::uint32_t>(mode.height);
  format.fmt.pix.pixelformat = code;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (ioctl(VIDIOC_S_FMT, &format) != 0) {
    return error("its format cannot be set");
  }
  const auto& given = format.fmt.pix;
  if (given.pixelformat != code || given.width != static_cast<std::uint32_t>(mode.width) ||
      given.height != static_cast<std::uint32_t>(mode.height)) {
    return fail(ErrorCode::kUnsupported, "{}: gives {}x{} instead of {}x{}", name_,
                std::uint32_t{given.width}, std::uint32_t{given.height}, mode.width, mode.height);
  }
  v4l2_streamparm parameters{};
  parameters.type = buffer_type();
  parameters.parm.capture.timeperframe = {.numerator = 1,
                                          .denominator = static_cast<std::uint32_t>(mode.rate_hz)};
  if (ioctl(VIDIOC_S_PARM, &parameters) != 0) {
    return error("its rate cannot be set");
  }
  return {};
}

Result<void> VideoDevice::set_metadata_format(std::span<const std::uint32_t> codes) {
  for (const std::uint32_t code : codes) {
    v4l2_format format{};
    format.type = buffer_type();
    format.fmt.meta.dataformat = code;
    if (ioctl(VIDIOC_S_FMT, &format) == 0 && format.fmt.meta.dataformat == code) {
      return {};
    }
  }
  return error("it takes no known format of metadata");
}

Result<void> VideoDevice::start(int buffers) {
  stop();
  v4l2_requestbuffers request{};
  request.count = static_cast<std::uint32_t>(buffers);
  request.type = buffer_type();
  request.memory = V4L2_MEMORY_MMAP;
  if (ioctl(VIDIOC_REQBUFS, &request) != 0) {
    return error("no buffers");
  }
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer{};
    buffer.index = i;
    buffer.type = buffer_type();
    buffer.memory = V4L2_MEMORY_MMAP;
    if (ioctl(VIDIOC_QUERYBUF, &buffer) != 0) {
      return error("a buffer cannot be asked for");
    }
    void* const memory = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED,
                                fd_.get(), static_cast<off_t>(buffer.m.offset));
    if (memory == MAP_FAILED) {
      return error("a buffer cannot be mapped");
    }
    buffers_.emplace_back(static_cast<std::byte*>(memory), Unmap{.size = buffer.length});
    if (ioctl(VIDIOC_QBUF, &buffer) != 0) {
      return error("a buffer cannot be queued");
    }
  }
  auto type = static_cast<int>(buffer_type());
  if (ioctl(VIDIOC_STREAMON, &type) != 0) {
    return error("it does not start");
  }
  streaming_ = true;
  return {};
}

void VideoDevice::stop() noexcept {
  if (!fd_) {
    return;
  }
  if (streaming_) {
    auto type = static_cast<int>(buffer_type());
    (void)ioctl(VIDIOC_STREAMOFF, &type);  // a device that is gone has stopped
    streaming_ = false;
  }
  if (!buffers_.empty()) {
    buffers_.clear();
    v4l2_requestbuffers none{};
    none.type = buffer_type();
    none.memory = V4L2_MEMORY_MMAP;
    (void)ioctl(VIDIOC_REQBUFS, &none);
  }
}

Result<std::optional<Filled>> VideoDevice::take() {
  v4l2_buffer buffer{};
  buffer.type = buffer_type();
  buffer.memory = V4L2_MEMORY_MMAP;
  if (ioctl(VIDIOC_DQBUF, &buffer) != 0) {
    if (errno == EAGAIN) {
      return std::nullopt;
    }
    return error("no frame can be taken");
  }
  if (buffer.index >= buffers_.size()) {
    return fail(ErrorCode::kSystem, "{}: buffer {} of {}", name_, std::uint32_t{buffer.index},
                buffers_.size());
  }
  const Mapping& memory = buffers_[buffer.index];
  const std::size_t used = std::min<std::size_t>(buffer.bytesused, memory.get_deleter().size);
  return Filled{.index = buffer.index,
                .sequence = buffer.sequence,
                .damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0,
                .bytes = {memory.get(), used}};
}

Result<void> VideoDevice::give_back(const Filled& filled) {
  v4l2_buffer buffer{};
  buffer.index = filled.index;
  buffer.type = buffer_type();
  buffer.memory = V4L2_MEMORY_MMAP;
  return ioctl(VIDIOC_QBUF, &buffer) == 0 ? Result<void>{} : error("a buffer cannot be queued");
}

Result<void> VideoDevice::query_unit(std::uint8_t unit, std::uint8_t selector, std::uint8_t request,
                                     std::span<std::byte> data) {
  void* const bytes = data.data();
  uvc_xu_control_query query{};
  query.unit = unit;
  query.selector = selector;
  query.query = request;
  query.size = static_cast<std::uint16_t>(data.size());
  query.data = static_cast<std::uint8_t*>(bytes);
  return ioctl(UVCIOC_CTRL_QUERY, &query) == 0 ? Result<void>{} : error("a control request failed");
}

}  // namespace geoflow::drivers::v4l2
