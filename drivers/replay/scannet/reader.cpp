#include "replay/scannet/reader.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <ios>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

#include "replay/decode.hpp"
#include "replay/reader.hpp"
#include "replay/scannet/format.hpp"
#include "replay/scannet/geometry.hpp"

namespace geoflow::drivers::scannet {
namespace {

using Path = std::filesystem::path;

constexpr std::string_view kExtension = ".sens";
/// The Structure sensor's rate, at which all scans were made.
constexpr double kFrameRateHz = 30;
/// Stamps are microseconds; larger ones would not fit a Duration.
constexpr std::uint64_t kLatestStampUs =
    std::numeric_limits<std::int64_t>::max() / std::int64_t{2000};

/// One frame's place in the file.
struct Frame {
  FrameHeader header;
  std::uint64_t offset = 0;  ///< of its colour image
};

/// The `.sens` file that `path` is or holds; empty where there is none, or more than one.
Path find_file(const Path& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) {
    return path.extension() == kExtension ? path : Path{};
  }
  Path found;
  for (const auto& entry : std::filesystem::directory_iterator{path, error}) {
    if (entry.path().extension() != kExtension || !entry.is_regular_file(error)) {
      continue;
    }
    if (!found.empty()) {
      return {};
    }
    found = entry.path();
  }
  return found;
}

/// `count` bytes at `offset`, or as many as there are.
std::vector<std::byte> read_at(std::ifstream& file, std::uint64_t offset, std::uint64_t count) {
  std::vector<std::byte> bytes(count);
  void* const target = bytes.data();
  file.clear();
  file.seekg(static_cast<std::streamoff>(offset));
  file.read(static_cast<char*>(target), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return bytes;
}

/// The frames that are whole, in the file's order.
std::vector<Frame> find_frames(std::ifstream& file, const Header& header, std::uint64_t size) {
  std::vector<Frame> frames;
  std::uint64_t offset = header.size_bytes;
  while (frames.size() < header.frames && size - offset >= kFrameHeaderBytes) {
    const auto bytes = read_at(file, offset, kFrameHeaderBytes);
    if (bytes.size() < kFrameHeaderBytes) {
      break;
    }
    const Frame frame{.header = parse_frame_header(std::span{bytes}.first<kFrameHeaderBytes>()),
                      .offset = offset + kFrameHeaderBytes};
    const std::uint64_t left = size - frame.offset;
    if (frame.header.color_bytes > std::min(kLargestImage, left) ||
        frame.header.depth_bytes > std::min(kLargestImage, left - frame.header.color_bytes)) {
      break;
    }
    offset = frame.offset + frame.header.color_bytes + frame.header.depth_bytes;
    frames.push_back(frame);
  }
  return frames;
}

/// Whether every frame has stamps, each larger than the one before.
bool stamps_are_times(const std::vector<Frame>& frames) {
  const auto fits = [](std::uint64_t stamp_us) {
    return stamp_us > 0 && stamp_us < kLatestStampUs;
  };
  const bool all_fit = std::ranges::all_of(frames, [&](const Frame& frame) {
    return fits(frame.header.color_us) && fits(frame.header.depth_us);
  });
  const auto not_later = [](const Frame& a, const Frame& b) {
    return b.header.color_us <= a.header.color_us || b.header.depth_us <= a.header.depth_us;
  };
  return all_fit && std::ranges::adjacent_find(frames, not_later) == frames.end();
}

class Reader final : public RecordingReader {
 public:
  Reader(const Path& path, std::ifstream file, Header header, std::vector<Frame> frames)
      : name_{path.filename().string()},
        file_{std::move(file)},
        header_{std::move(header)},
        frames_{std::move(frames)},
        stamped_{stamps_are_times(frames_)},
        resample_{header_.color, header_.depth} {
    const std::uint64_t count = frames_.size();
    info_ = RecordingInfo{
        .format = "scannet",
        .start = std::min(time_of(0, ImageStream::kColor), time_of(0, ImageStream::kDepth)),
        .end = arrival_of_frame(frames_.size() - 1),
        .streams = {{.name = name_, .type = "color", .count = count, .stream = StreamId::kColor},
                    {.name = name_, .type = "depth", .count = count, .stream = StreamId::kDepth}}};
  }

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }

  [[nodiscard]] FoundCalibration calibration() const override {
    return {.camera = header_.depth,
            .depth_unit_m = 1 / header_.depth_counts_per_m,
            .source = fmt::format("{} ({})", name_, header_.sensor)};
  }

  [[nodiscard]] Trajectory reference() const override {
    Trajectory poses;
    const SE3 T_depth_color = header_.T_color_depth.inverse();
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (const auto& T_world_depth = frames_[i].header.T_world_depth) {
        poses.push_back({time_of(i, ImageStream::kColor), *T_world_depth * T_depth_color});
      }
    }
    return poses;
  }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    if (at_ == frames_.size()) {
      if (complete() || told_) {
        return std::nullopt;
      }
      told_ = true;
      return fail(ErrorCode::kInvalidData, "{}: is cut off: {} of {} frames are there", name_,
                  frames_.size(), header_.frames);
    }
    const ImageStream stream = second_ ? ImageStream::kDepth : ImageStream::kColor;
    const std::size_t index = second_ ? at_++ : at_;
    second_ = !second_;
    auto image = stream == ImageStream::kColor ? color(index) : depth(index);
    return std::move(image)
        .map([&](EncodedImage content) -> std::optional<Event> {
          const HostTime t = time_of(index, stream);
          return Arrival<CameraClock, EncodedImage>{
              .t_device = DeviceTime<CameraClock>{t.time_since_epoch()},
              .t_arrival = arrival_of_frame(index),
              .sample = std::move(content)};
        })
        .map_error([&](Error error) { return std::move(error).in(origin(index)); });
  }

  [[nodiscard]] bool complete() const override { return frames_.size() == header_.frames; }

 private:
  [[nodiscard]] std::string origin(std::size_t index) const {
    return fmt::format("{}: frame {}", name_, index);
  }

  [[nodiscard]] HostTime time_of(std::size_t index, ImageStream stream) const {
    if (!stamped_) {
      return HostTime{from_seconds(static_cast<double>(index) / kFrameRateHz)};
    }
    const FrameHeader& header = frames_[index].header;
    const std::uint64_t stamp_us =
        stream == ImageStream::kColor ? header.color_us : header.depth_us;
    return HostTime{std::chrono::microseconds{static_cast<std::int64_t>(stamp_us)}};
  }

  /// Both images of a frame arrive together, and after those of the frame before.
  [[nodiscard]] HostTime arrival_of_frame(std::size_t index) const {
    return std::max(time_of(index, ImageStream::kColor), time_of(index, ImageStream::kDepth));
  }

  [[nodiscard]] EncodedImage raw(ImageStream stream, PixelFormat format,
                                 std::vector<std::byte> bytes, std::size_t index) const {
    const ImageShape shape{
        .width = header_.depth.width, .height = header_.depth.height, .format = format};
    return {.stream = stream,
            .encoding = ImageEncoding::kRaw,
            .raw = {.shape = shape, .step_bytes = shape.row_bytes()},
            .bytes = std::move(bytes),
            .origin = origin(index)};
  }

  [[nodiscard]] Result<EncodedImage> color(std::size_t index) {
    const Frame& frame = frames_[index];
    const ImageShape shape{
        .width = header_.color.width, .height = header_.color.height, .format = PixelFormat::kRgb8};
    const EncodedImage stored{.encoding = header_.color_coding == ColorCoding::kRaw
                                              ? ImageEncoding::kRaw
                                              : ImageEncoding::kCompressed,
                              .raw = {.shape = shape, .step_bytes = shape.row_bytes()},
                              .bytes = read_at(file_, frame.offset, frame.header.color_bytes),
                              .origin = name_};
    const auto full = decode(stored, {.width = shape.width, .height = shape.height},
                             [this](const ImageShape& wanted) { return pool_.acquire(wanted); });
    return full.map([&](const FrameRef& image) {
      return raw(ImageStream::kColor, PixelFormat::kBgr8, resample_(image.bytes()), index);
    });
  }

  [[nodiscard]] Result<EncodedImage> depth(std::size_t index) {
    const Frame& frame = frames_[index];
    const auto stored =
        read_at(file_, frame.offset + frame.header.color_bytes, frame.header.depth_bytes);
    return decode_depth(header_, stored).map([&](const std::vector<std::uint16_t>& own) {
      const auto moved = register_depth(own, header_.depth, header_.depth, header_.T_color_depth,
                                        header_.depth_counts_per_m);
      std::vector<std::byte> bytes(moved.size() * sizeof(std::uint16_t));
      std::memcpy(bytes.data(), moved.data(), bytes.size());
      return raw(ImageStream::kDepth, PixelFormat::kDepth16, std::move(bytes), index);
    });
  }

  std::string name_;
  std::ifstream file_;
  Header header_;
  std::vector<Frame> frames_;
  bool stamped_;
  ColorResampler resample_;
  FramePool pool_{1};
  RecordingInfo info_;
  std::size_t at_ = 0;   // the next frame
  bool second_ = false;  // its colour was given already
  bool told_ = false;    // that the file is cut off
};

}  // namespace

bool looks_like(const Path& path) {
  return !find_file(path).empty();
}

Result<std::unique_ptr<RecordingReader>> open(const Path& path) {
  const Path found = find_file(path);
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(found, error);
  std::ifstream file{found, std::ios::binary};
  if (error || !file) {
    return fail(ErrorCode::kSystem, "{}: cannot be read", found.string());
  }
  auto header =
      parse_header(found.string(), read_at(file, 0, std::min(size, std::uint64_t{kLargestHeader})));
  if (!header) {
    return tl::unexpected{std::move(header.error())};
  }
  auto frames = find_frames(file, *header, size);
  if (frames.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: has no whole frame", found.string());
  }
  return std::make_unique<Reader>(found, std::move(file), *std::move(header), std::move(frames));
}

}  // namespace geoflow::drivers::scannet
