#include "replay/scannet/format.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <zlib.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::scannet {
namespace {

static_assert(std::endian::native == std::endian::little, "values are copied as they stand");

constexpr std::uint64_t kLongestName = 1024;
constexpr int kLargestSide = 8192;
/// How far R^T R may be from the identity: poses are floats.
constexpr double kRotationTolerance = 1e-2;

/// Values one behind the other, zero once the bytes have ended.
class Cursor {
 public:
  explicit Cursor(std::span<const std::byte> bytes) noexcept : bytes_{bytes} {}

  template <typename Value>
  [[nodiscard]] Value take() noexcept {
    Value value{};
    if (bytes_.size() - at_ < sizeof value) {
      complete_ = false;
      at_ = bytes_.size();
      return Value{};
    }
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }

  [[nodiscard]] std::string take_text(std::uint64_t length) {
    if (bytes_.size() - at_ < length) {
      complete_ = false;
      at_ = bytes_.size();
      return {};
    }
    std::string text(length, '\0');
    std::memcpy(text.data(), bytes_.data() + at_, text.size());
    at_ += text.size();
    return text;
  }

  [[nodiscard]] bool complete() const noexcept { return complete_; }
  [[nodiscard]] std::size_t at() const noexcept { return at_; }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
  bool complete_ = true;
};

using Matrix4d = Eigen::Matrix4d;

Matrix4d take_matrix(Cursor& cursor) {
  using Rows = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  const auto values = cursor.take<std::array<float, Rows::SizeAtCompileTime>>();
  return Eigen::Map<const Rows>{values.data()}.cast<double>();
}

/// None where it is no rigid transform.
std::optional<SE3> transform_of(const Matrix4d& matrix) {
  if (!matrix.allFinite()) {
    return std::nullopt;
  }
  const Matrix3d R = matrix.topLeftCorner<3, 3>();
  const bool rotation =
      (R.transpose() * R - Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRotationTolerance &&
      R.determinant() > 0;
  return rotation ? std::optional{SE3{R, matrix.topRightCorner<3, 1>()}} : std::nullopt;
}

bool is_camera(const CameraIntrinsics& camera) {
  const auto is_side = [](int side) { return side > 0 && side <= kLargestSide; };
  const auto is_focal = [](double focal) { return std::isfinite(focal) && focal > 1; };
  return is_side(camera.width) && is_side(camera.height) && is_focal(camera.fx) &&
         is_focal(camera.fy) && std::isfinite(camera.cx) && std::isfinite(camera.cy);
}

CameraIntrinsics camera_of(const Matrix4d& K, std::uint32_t width, std::uint32_t height) {
  const auto side = [](std::uint32_t value) {
    return static_cast<int>(std::min<std::uint32_t>(value, kLargestSide + 1));
  };
  return {.width = side(width),
          .height = side(height),
          .fx = K(0, 0),
          .fy = K(1, 1),
          .cx = K(0, 2),
          .cy = K(1, 2)};
}

Result<void> set_codings(std::string_view file, std::int32_t color, std::int32_t depth,
                         Header& header) {
  constexpr std::int32_t kOcci = 2;
  if (color < 0 || color > static_cast<std::int32_t>(ColorCoding::kJpeg)) {
    return fail(ErrorCode::kUnsupported,
                "{}: colour coding {}: raw (0), PNG (1) or JPEG (2) are read", file, color);
  }
  if (depth < 0 || depth > static_cast<std::int32_t>(DepthCoding::kZlib)) {
    return fail(ErrorCode::kUnsupported, "{}: depth coding {}{}: raw (0) or zlib (1) are read",
                file, depth, depth == kOcci ? " (occi)" : "");
  }
  header.color_coding = static_cast<ColorCoding>(color);
  header.depth_coding = static_cast<DepthCoding>(depth);
  return {};
}

Result<void> check(std::string_view file, const Header& header) {
  if (!is_camera(header.color) || !is_camera(header.depth)) {
    return fail(ErrorCode::kInvalidData, "{}: size or intrinsics of the {} camera are out of range",
                file, is_camera(header.color) ? "depth" : "colour");
  }
  if (!std::isfinite(header.depth_counts_per_m) || header.depth_counts_per_m < 1) {
    return fail(ErrorCode::kInvalidData, "{}: a depth shift of {} counts per metre", file,
                header.depth_counts_per_m);
  }
  return {};
}

}  // namespace

bool has_version(std::span<const std::byte> bytes) noexcept {
  Cursor cursor{bytes};
  return cursor.take<std::uint32_t>() == kVersion;
}

Result<Header> parse_header(std::string_view file, std::span<const std::byte> bytes) {
  Cursor cursor{bytes};
  if (const auto version = cursor.take<std::uint32_t>(); version != kVersion) {
    return fail(ErrorCode::kUnsupported, "{}: .sens version {}, version {} is read", file, version,
                kVersion);
  }
  const auto name_bytes = cursor.take<std::uint64_t>();
  if (name_bytes > kLongestName) {
    return fail(ErrorCode::kInvalidData, "{}: a sensor name of {} bytes", file, name_bytes);
  }
  Header header{.sensor = cursor.take_text(name_bytes)};
  const Matrix4d K_color = take_matrix(cursor);
  const auto T_base_color = transform_of(take_matrix(cursor));
  const Matrix4d K_depth = take_matrix(cursor);
  const auto T_base_depth = transform_of(take_matrix(cursor));
  const auto color_coding = cursor.take<std::int32_t>();
  const auto depth_coding = cursor.take<std::int32_t>();
  const auto sides = cursor.take<std::array<std::uint32_t, 4>>();
  header.color = camera_of(K_color, sides[0], sides[1]);
  header.depth = camera_of(K_depth, sides[2], sides[3]);
  header.depth_counts_per_m = static_cast<double>(cursor.take<float>());
  header.frames = cursor.take<std::uint64_t>();
  header.size_bytes = cursor.at();
  if (!cursor.complete()) {
    return fail(ErrorCode::kInvalidData, "{}: is cut off within its header", file);
  }
  if (!T_base_color || !T_base_depth) {
    return fail(ErrorCode::kInvalidData, "{}: the {} camera's extrinsic is not a rigid transform",
                file, T_base_color ? "depth" : "colour");
  }
  header.T_color_depth = T_base_color->inverse() * *T_base_depth;
  auto checked = set_codings(file, color_coding, depth_coding, header);
  if (checked) {
    checked = check(file, header);
  }
  return std::move(checked).map([&] { return std::move(header); });
}

FrameHeader parse_frame_header(std::span<const std::byte, kFrameHeaderBytes> bytes) noexcept {
  Cursor cursor{bytes};
  FrameHeader frame{.T_world_depth = transform_of(take_matrix(cursor))};
  frame.color_us = cursor.take<std::uint64_t>();
  frame.depth_us = cursor.take<std::uint64_t>();
  frame.color_bytes = cursor.take<std::uint64_t>();
  frame.depth_bytes = cursor.take<std::uint64_t>();
  return frame;
}

Result<std::vector<std::uint16_t>> decode_depth(const Header& header,
                                                std::span<const std::byte> bytes) {
  std::vector<std::uint16_t> depth(static_cast<std::size_t>(header.depth.width) *
                                   static_cast<std::size_t>(header.depth.height));
  const std::size_t expected = depth.size() * sizeof(std::uint16_t);
  if (header.depth_coding == DepthCoding::kRaw) {
    if (bytes.size() != expected) {
      return fail(ErrorCode::kInvalidData, "{} bytes of depth, {} belong there", bytes.size(),
                  expected);
    }
    std::memcpy(depth.data(), bytes.data(), expected);
    return depth;
  }
  unsigned long length = expected;
  void* const target = depth.data();
  const void* const source = bytes.data();
  const int status = ::uncompress(static_cast<unsigned char*>(target), &length,
                                  static_cast<const unsigned char*>(source), bytes.size());
  if (status != Z_OK || length != expected) {
    return fail(ErrorCode::kInvalidData, "a damaged depth image (zlib: {}, {} of {} bytes)", status,
                length, expected);
  }
  return depth;
}

}  // namespace geoflow::drivers::scannet
