#include "replay/oni/reader.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <ios>
#include <memory>
#include <numbers>
#include <optional>
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
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "openni2/pixels.hpp"
#include "replay/oni/depth_codec.hpp"
#include "replay/oni/structure.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::oni {
namespace {

using Path = std::filesystem::path;
using openni2::SourcePixel;

// OniPixelFormat (OniCEnums.h).
constexpr int kDepth100Um = 101;
constexpr int kRgb888 = 200;
constexpr int kYuv422 = 201;
constexpr int kGray8 = 202;
constexpr int kYuyv = 205;

constexpr double kMillimetre_m = 1e-3;
constexpr double kTenthMillimetre_m = 1e-4;
/// Stamps are microseconds; larger ones would not fit a Duration.
constexpr std::uint64_t kLatestStamp_us = 1ULL << 52U;

std::optional<SourcePixel> color_pixel(int format) {
  switch (format) {
    case kRgb888:
      return SourcePixel::kRgb888;
    case kYuv422:
      return SourcePixel::kUyvy;
    case kGray8:
      return SourcePixel::kGray8;
    case kYuyv:
      return SourcePixel::kYuyv;
    default:
      return std::nullopt;
  }
}

/// Nothing where this reader can decode such a stream.
Result<void> check_codec(const Node& node, std::string_view name) {
  if (node.kind == NodeKind::kDepth) {
    if (node.codec == Codec::kDepth || node.codec == Codec::kDepthWithTable ||
        node.codec == Codec::kUncompressed) {
      return {};
    }
    return fail(ErrorCode::kUnsupported, "{}: depth is compressed by an unknown codec ({:#x})",
                name, static_cast<std::uint32_t>(node.codec));
  }
  if (node.codec == Codec::kJpeg ||
      (node.codec == Codec::kUncompressed && color_pixel(node.pixel_format))) {
    return {};
  }
  return fail(ErrorCode::kUnsupported,
              "{}: colour is compressed by an unknown codec ({:#x}) or has unknown pixels ({})",
              name, static_cast<std::uint32_t>(node.codec), node.pixel_format);
}

double focal_px(int size_px, std::optional<double> fov_rad) {
  const bool usable = fov_rad && *fov_rad > 0 && *fov_rad < std::numbers::pi;
  return usable ? size_px / (2 * std::tan(*fov_rad / 2)) : 0;
}

class Reader final : public RecordingReader {
 public:
  /// `structure` has frames of these two streams alone, and at least one.
  Reader(const Path& path, std::ifstream file, Structure structure, const Node& color,
         const Node& depth)
      : name_{path.filename().string()},
        file_{std::move(file)},
        frames_{std::move(structure.frames)},
        complete_{structure.complete},
        bytes_{structure.bytes},
        color_{color},
        depth_{depth} {
    const auto count = [&](const Node& node) {
      return static_cast<std::uint64_t>(std::ranges::count(frames_, node.id, &StoredFrame::node));
    };
    const auto latest = std::ranges::max_element(frames_, {}, &StoredFrame::t_us);
    info_ = RecordingInfo{
        .format = "oni",
        .start = time_of(frames_.front()),
        .end = time_of(*latest),
        .streams = {
            {.name = name_, .type = "color", .count = count(color_), .stream = StreamId::kColor},
            {.name = name_, .type = "depth", .count = count(depth_), .stream = StreamId::kDepth}}};
  }

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }
  [[nodiscard]] bool complete() const override { return complete_; }

  [[nodiscard]] FoundCalibration calibration() const override {
    FoundCalibration found{
        .depth_unit_m = depth_.pixel_format == kDepth100Um ? kTenthMillimetre_m : kMillimetre_m,
        .source = fmt::format("fields of view in {}", name_)};
    const double fx = focal_px(color_.width, color_.horizontal_fov_rad);
    const double fy = focal_px(color_.height, color_.vertical_fov_rad);
    if (fx > 0 && fy > 0) {
      found.camera = CameraIntrinsics{.width = color_.width,
                                      .height = color_.height,
                                      .fx = fx,
                                      .fy = fy,
                                      .cx = (color_.width - 1) / 2.0,
                                      .cy = (color_.height - 1) / 2.0};
    }
    return found;
  }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    if (at_ == frames_.size()) {
      if (complete_ || told_) {
        return std::nullopt;
      }
      told_ = true;
      return fail(ErrorCode::kInvalidData, "{}: is cut off at byte {}, after {} frames", name_,
                  bytes_, at_);
    }
    const std::size_t index = at_++;
    const StoredFrame& frame = frames_[index];
    auto image = frame.node == color_.id ? color(index) : depth(index);
    return std::move(image)
        .map([&](EncodedImage content) -> std::optional<Event> {
          const HostTime t = time_of(frame);
          newest_ = std::max(newest_, t);
          return Arrival<CameraClock, EncodedImage>{
              .t_device = DeviceTime<CameraClock>{t.time_since_epoch()},
              .t_arrival = newest_,
              .sample = std::move(content)};
        })
        .map_error([&](Error error) { return std::move(error).in(origin(index)); });
  }

 private:
  [[nodiscard]] std::string origin(std::size_t index) const {
    return fmt::format("{}: frame {}", name_, index);
  }
  [[nodiscard]] static HostTime time_of(const StoredFrame& frame) {
    const std::uint64_t t_us = std::min(frame.t_us, kLatestStamp_us);
    return HostTime{std::chrono::microseconds{static_cast<std::int64_t>(t_us)}};
  }
  [[nodiscard]] std::vector<std::byte> content(const StoredFrame& frame) {
    std::vector<std::byte> bytes(frame.bytes);
    void* const target = bytes.data();
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(frame.offset));
    file_.read(static_cast<char*>(target), static_cast<std::streamsize>(frame.bytes));
    bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file_.gcount(), 0)));
    return bytes;
  }
  [[nodiscard]] EncodedImage raw(ImageStream stream, const ImageShape& shape,
                                 std::vector<std::byte> bytes, std::size_t index) const {
    return {.stream = stream,
            .encoding = ImageEncoding::kRaw,
            .raw = {.shape = shape, .step_bytes = shape.row_bytes()},
            .bytes = std::move(bytes),
            .origin = origin(index)};
  }

  [[nodiscard]] Result<EncodedImage> color(std::size_t index) {
    auto bytes = content(frames_[index]);
    if (color_.codec == Codec::kJpeg) {
      return EncodedImage{.stream = ImageStream::kColor,
                          .encoding = ImageEncoding::kCompressed,
                          .bytes = std::move(bytes),
                          .origin = origin(index)};
    }
    const SourcePixel pixel = *color_pixel(color_.pixel_format);
    ImageShape shape{.width = color_.width, .height = color_.height};
    if (pixel == SourcePixel::kRgb888 || pixel == SourcePixel::kGray8) {
      shape.format = pixel == SourcePixel::kGray8 ? PixelFormat::kGray8 : PixelFormat::kRgb8;
      return raw(ImageStream::kColor, shape, std::move(bytes), index);
    }
    shape.format = PixelFormat::kBgr8;
    std::vector<std::byte> pixels(shape.size_bytes());
    const std::size_t step = bytes.size() / static_cast<std::size_t>(color_.height);
    return openni2::convert({.pixel = pixel,
                             .width = color_.width,
                             .height = color_.height,
                             .step_bytes = step,
                             .bytes = bytes},
                            shape, pixels)
        .map([&] { return raw(ImageStream::kColor, shape, std::move(pixels), index); });
  }

  [[nodiscard]] Result<EncodedImage> depth(std::size_t index) {
    auto bytes = content(frames_[index]);
    const ImageShape shape{
        .width = depth_.width, .height = depth_.height, .format = PixelFormat::kDepth16};
    if (depth_.codec == Codec::kUncompressed) {
      return raw(ImageStream::kDepth, shape, std::move(bytes), index);
    }
    const bool with_table = depth_.codec == Codec::kDepthWithTable;
    const std::size_t pixels = shape.size_bytes() / sizeof(std::uint16_t);
    return decode_depth(bytes, with_table, pixels).map([&](const auto& values) {
      std::vector<std::byte> decoded(shape.size_bytes());
      std::memcpy(decoded.data(), values.data(), decoded.size());
      return raw(ImageStream::kDepth, shape, std::move(decoded), index);
    });
  }

  std::string name_;
  std::ifstream file_;
  std::vector<StoredFrame> frames_;
  bool complete_;
  std::uint64_t bytes_;  // up to which the file is whole
  Node color_;
  Node depth_;
  RecordingInfo info_;
  std::size_t at_ = 0;  // the next frame
  HostTime newest_{};   // arrival of the newest frame
  bool told_ = false;   // that the file is cut off
};

}  // namespace

bool looks_like(const Path& path) {
  constexpr std::string_view kMagic = "NI10";
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return false;
  }
  std::ifstream file{path, std::ios::binary};
  std::array<char, kMagic.size()> magic{};
  file.read(magic.data(), magic.size());
  return file && std::string_view{magic.data(), magic.size()} == kMagic;
}

Result<std::unique_ptr<RecordingReader>> open(const Path& path) {
  auto structure = read_structure(path);
  if (!structure) {
    return tl::unexpected{std::move(structure.error())};
  }
  const auto color = std::ranges::find(structure->nodes, NodeKind::kColor, &Node::kind);
  const auto depth = std::ranges::find(structure->nodes, NodeKind::kDepth, &Node::kind);
  if (color == structure->nodes.end() || depth == structure->nodes.end()) {
    return fail(ErrorCode::kUnsupported, "{}: has no {} stream", path.string(),
                color == structure->nodes.end() ? "colour" : "depth");
  }
  const Node its_color = *color;
  const Node its_depth = *depth;
  if (its_color.width != its_depth.width || its_color.height != its_depth.height) {
    return fail(ErrorCode::kUnsupported, "{}: colour is {}x{}, depth {}x{}: they must be equal",
                path.string(), its_color.width, its_color.height, its_depth.width,
                its_depth.height);
  }
  const auto known = check_codec(its_color, path.string()).and_then([&] {
    return check_codec(its_depth, path.string());
  });
  if (!known) {
    return tl::unexpected{known.error()};
  }
  std::erase_if(structure->frames, [&](const StoredFrame& frame) {
    return frame.node != its_color.id && frame.node != its_depth.id;
  });
  if (structure->frames.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: has no whole frame", path.string());
  }
  return std::make_unique<Reader>(path, std::ifstream{path, std::ios::binary},
                                  *std::move(structure), its_color, its_depth);
}

}  // namespace geoflow::drivers::oni
