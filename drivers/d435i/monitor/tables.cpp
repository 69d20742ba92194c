#include "d435i/monitor/tables.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>
#include <zconf.h>
#include <zlib.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/monitor/command.hpp"
#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

constexpr std::size_t kHeaderBytes = 16;
constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kRadiansPerDegree = std::numbers::pi / 180;

struct Size {
  int width;
  int height;
};
/// The resolutions of table 25's list, in its order (librealsense, src/ds/ds-private.h).
constexpr std::array<Size, 10> kListed{{{1920, 1080},
                                        {1280, 720},
                                        {640, 480},
                                        {848, 480},
                                        {640, 360},
                                        {424, 240},
                                        {320, 240},
                                        {480, 270},
                                        {1280, 800},
                                        {960, 540}}};

/// A resolution that shows a part of a listed one: its first pixel is (left, top) of that.
struct Crop {
  Size size;
  Size of;
  double left;
  double top;
};
constexpr std::array<Crop, 2> kCrops{
    {{{848, 100}, {848, 480}, 0, 190}, {{256, 144}, {1920, 1080}, 832, 468}}};

// Bytes of table 25 and 32 that are passed over, by what lies there.
constexpr std::size_t kMatrixBytes = 9 * sizeof(float);
constexpr std::size_t kLeftRightAndWorldRotations = 4 * kMatrixBytes;
constexpr std::size_t kReservedBeforeList = 88;
constexpr std::size_t kColorPoseAndProjection = (3 + 3 + 12) * sizeof(float);

/// No pinhole of this camera has a focal length or centre beyond this [px].
constexpr double kLargestPixels = 1e5;
/// Its sensors lie nearer to one another than this [m].
constexpr double kLargestOffset_m = 0.5;
/// How far a stored rotation's product with its transpose may be from the identity.
constexpr double kRotationTolerance = 1e-3;

Vector3d take_vector(FieldReader& fields) {
  const auto v = fields.take_array<float, 3>();
  return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}

Matrix3d take_matrix(FieldReader& fields) {
  Matrix3d matrix;
  for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
    matrix.col(column) = take_vector(fields);
  }
  return matrix;
}

bool is_rotation(const Matrix3d& R) {
  return R.allFinite() && R.determinant() > 0 &&
         (R * R.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRotationTolerance;
}

bool is_offset(const Vector3d& t) {
  return t.allFinite() && t.norm() < kLargestOffset_m;
}

bool is_pinhole(const CameraIntrinsics& camera) {
  const auto within = [](double value) {
    return std::isfinite(value) && std::abs(value) < kLargestPixels;
  };
  return within(camera.fx) && within(camera.fy) && within(camera.cx) && within(camera.cy) &&
         camera.fx > 0 && camera.fy > 0;
}

/// The payload of a table whose header and checksum are right.
Result<std::span<const std::byte>> checked(std::span<const std::byte> table, std::string_view name,
                                           std::optional<std::uint32_t> type) {
  FieldReader header{table};
  header.skip(sizeof(std::uint16_t));  // version
  const auto stored_type = header.take<std::uint16_t>();
  header.skip(2 * sizeof(std::uint32_t));  // payload size, parameter
  const auto stored_crc = header.take<std::uint32_t>();
  if (!header.ok()) {
    return fail(ErrorCode::kInvalidData, "{}: {} bytes, shorter than its header of {}", name,
                table.size(), kHeaderBytes);
  }
  if (type && stored_type != *type) {
    return fail(ErrorCode::kInvalidData, "{}: the camera sent table {} instead of {}", name,
                stored_type, *type);
  }
  const auto payload = header.left();
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): zlib's bytes
  const auto* const bytes = reinterpret_cast<const Bytef*>(payload.data());
  const auto crc = ::crc32(0, bytes, static_cast<uInt>(payload.size()));
  if (crc != stored_crc) {
    return fail(ErrorCode::kInvalidData, "{}: its checksum is {:#010x} where {:#010x} is stored",
                name, crc, stored_crc);
  }
  return payload;
}

tl::unexpected<Error> ends_early(std::string_view name, std::size_t bytes) {
  return fail(ErrorCode::kInvalidData, "{}: ends after {} bytes, before its last field", name,
              bytes);
}

CameraIntrinsics take_pinhole(FieldReader& fields, Size size) {
  const auto values = fields.take_array<float, 4>();
  return {.width = size.width,
          .height = size.height,
          .fx = static_cast<double>(values[0]),
          .fy = static_cast<double>(values[1]),
          .cx = static_cast<double>(values[2]),
          .cy = static_cast<double>(values[3])};
}

const CameraIntrinsics* find_size(const std::vector<CameraIntrinsics>& list, Size size) {
  const auto found = std::ranges::find_if(list, [&](const CameraIntrinsics& listed) {
    return listed.width == size.width && listed.height == size.height;
  });
  return found == list.end() ? nullptr : &*found;
}

}  // namespace

Result<DepthTable> parse_depth_table(std::span<const std::byte> table) {
  constexpr std::string_view kName = "depth calibration";
  const auto payload = checked(table, kName, kCoefficientsTable);
  if (!payload) {
    return tl::unexpected{payload.error()};
  }
  FieldReader fields{*payload};
  fields.skip(kLeftRightAndWorldRotations);
  DepthTable parsed;
  parsed.baseline_m = kMetresPerMillimetre * std::abs(static_cast<double>(fields.take<float>()));
  fields.skip(sizeof(std::uint32_t) + kReservedBeforeList);  // distortion model
  for (const Size size : kListed) {
    const CameraIntrinsics camera = take_pinhole(fields, size);
    if (is_pinhole(camera)) {
      parsed.intrinsics.push_back(camera);
    }
  }
  if (!fields.ok()) {
    return ends_early(kName, table.size());
  }
  if (!std::isfinite(parsed.baseline_m) || parsed.baseline_m > kLargestOffset_m) {
    return fail(ErrorCode::kInvalidData, "{}: a baseline of {} m", kName, parsed.baseline_m);
  }
  return parsed;
}

Result<ColorTable> parse_color_table(std::span<const std::byte> table) {
  constexpr std::string_view kName = "colour calibration";
  const auto payload = checked(table, kName, kColorTable);
  if (!payload) {
    return tl::unexpected{payload.error()};
  }
  FieldReader fields{*payload};
  ColorTable parsed;
  parsed.K_normalised = take_matrix(fields);
  const auto distortion = fields.take_array<float, kMaxDistortionCoefficients>();
  std::ranges::copy(distortion, parsed.distortion.begin());
  fields.skip(kColorPoseAndProjection);
  parsed.width = fields.take<std::uint16_t>();
  parsed.height = fields.take<std::uint16_t>();
  fields.skip(kMatrixBytes);  // K of the rectified image
  const Matrix3d R_depth_cam = take_matrix(fields);
  const Vector3d offset_mm = take_vector(fields);
  if (!fields.ok()) {
    return ends_early(kName, table.size());
  }
  const Vector3d p_depth_cam = -kMetresPerMillimetre * offset_mm;
  if (!is_rotation(R_depth_cam) || !is_offset(p_depth_cam)) {
    return fail(ErrorCode::kInvalidData, "{}: its rotation or translation is none of this camera",
                kName);
  }
  parsed.T_depth_cam = SE3{R_depth_cam, p_depth_cam};
  const bool finite =
      std::ranges::all_of(parsed.distortion, [](double k) { return std::isfinite(k); });
  if (parsed.width == 0 || parsed.height == 0 || !finite ||
      !is_pinhole(color_intrinsics(parsed, parsed.width, parsed.height))) {
    return fail(ErrorCode::kInvalidData, "{}: its intrinsics are none of a camera", kName);
  }
  return parsed;
}

Result<ImuTable> parse_imu_table(std::span<const std::byte> table) {
  constexpr std::string_view kName = "IMU calibration";
  constexpr std::size_t kFurtherHeaders = 2 * kHeaderBytes;
  const auto payload = checked(table, kName, std::nullopt);
  if (!payload) {
    return tl::unexpected{payload.error()};
  }
  FieldReader fields{*payload};
  fields.skip(kFurtherHeaders);
  const bool has_extrinsics = fields.take<std::uint8_t>() == 1;
  const bool has_intrinsics = fields.take<std::uint8_t>() == 1;
  fields.skip(2);
  const Matrix3d R_imu_depth = take_matrix(fields);
  const Vector3d p_imu_depth = take_vector(fields);
  ImuTable parsed;
  const Matrix3d accel_scale = take_matrix(fields);
  const Vector3d accel_bias_mps2 = take_vector(fields);
  const Matrix3d gyro_scale = take_matrix(fields);
  const Vector3d gyro_bias_degps = take_vector(fields);
  if (!fields.ok()) {
    return ends_early(kName, table.size());
  }
  if (has_extrinsics) {
    if (!is_rotation(R_imu_depth) || !is_offset(p_imu_depth)) {
      return fail(ErrorCode::kInvalidData, "{}: its extrinsics are none of this camera", kName);
    }
    parsed.T_imu_depth = SE3{R_imu_depth, p_imu_depth};
  }
  if (has_intrinsics) {
    if (!accel_scale.allFinite() || !accel_bias_mps2.allFinite() || !gyro_scale.allFinite() ||
        !gyro_bias_degps.allFinite()) {
      return fail(ErrorCode::kInvalidData, "{}: its intrinsics are not numbers", kName);
    }
    parsed.accel_scale = accel_scale;
    parsed.accel_bias_mps2 = accel_bias_mps2;
    parsed.gyro_scale = gyro_scale;
    parsed.gyro_bias_radps = kRadiansPerDegree * gyro_bias_degps;
  }
  return parsed;
}

Result<std::vector<CameraIntrinsics>> parse_resolution_intrinsics(std::span<const std::byte> data) {
  constexpr std::size_t kItemBytes = 2 * sizeof(std::uint16_t) + 4 * sizeof(float);
  if (data.size() % kItemBytes != 0) {
    return fail(ErrorCode::kInvalidData, "depth intrinsics: {} bytes are no multiple of {}",
                data.size(), kItemBytes);
  }
  std::vector<CameraIntrinsics> list;
  FieldReader fields{data};
  while (!fields.left().empty()) {
    const int width = fields.take<std::uint16_t>();
    const int height = fields.take<std::uint16_t>();
    const CameraIntrinsics camera = take_pinhole(fields, {width, height});
    if (width > 0 && height > 0 && is_pinhole(camera)) {
      list.push_back(camera);
    }
  }
  return list;
}

Result<double> parse_depth_unit_m(std::span<const std::byte> data) {
  constexpr double kMetresPerMicrometre = 1e-6;
  constexpr std::uint32_t kLargest_um = 100'000;
  FieldReader fields{data};
  const auto unit_um = fields.take<std::uint32_t>();
  if (!fields.ok() || unit_um == 0 || unit_um > kLargest_um) {
    return fail(ErrorCode::kInvalidData, "a depth unit of {} um in {} bytes", unit_um, data.size());
  }
  return kMetresPerMicrometre * unit_um;
}

Result<CameraIntrinsics> depth_intrinsics(const DepthTable& table, int width, int height) {
  if (const auto* listed = find_size(table.intrinsics, {width, height})) {
    return *listed;
  }
  for (const Crop& crop : kCrops) {
    const auto* whole = find_size(table.intrinsics, crop.of);
    if (crop.size.width == width && crop.size.height == height && whole != nullptr) {
      CameraIntrinsics camera = *whole;
      camera.width = width;
      camera.height = height;
      camera.cx -= crop.left;
      camera.cy -= crop.top;
      return camera;
    }
  }
  const auto* largest = find_size(table.intrinsics, kListed.front());
  if (largest == nullptr) {
    return fail(ErrorCode::kNotFound, "depth calibration: no intrinsics for {}x{}", width, height);
  }
  const double x = static_cast<double>(width) / largest->width;
  const double y = static_cast<double>(height) / largest->height;
  return CameraIntrinsics{.width = width,
                          .height = height,
                          .fx = x * largest->fx,
                          .fy = y * largest->fy,
                          .cx = x * largest->cx,
                          .cy = y * largest->cy};
}

CameraIntrinsics color_intrinsics(const ColorTable& table, int width, int height) {
  Matrix3d K = table.K_normalised;
  const double aspect = static_cast<double>(height) / width;
  const double calibrated = static_cast<double>(table.height) / table.width;
  // The wider of the two images shows all of the sensor's width, or of its height.
  if (aspect < calibrated) {
    K.row(1) *= calibrated / aspect;
  } else {
    K.row(0) *= aspect / calibrated;
  }
  const bool distorted = std::ranges::any_of(table.distortion, [](double k) { return k != 0; });
  return {.width = width,
          .height = height,
          .fx = K(0, 0) * width / 2,
          .fy = K(1, 1) * height / 2,
          .cx = (1 + K(0, 2)) * width / 2,
          .cy = (1 + K(1, 2)) * height / 2,
          .model = distorted ? DistortionModel::kRadtan : DistortionModel::kNone,
          .distortion = table.distortion};
}

SE3 default_imu_pose() {
  // librealsense, src/ds/d400/ds-calib-parsers.cpp [m].
  const Vector3d p_imu_depth{-0.00552, 0.0051, 0.01174};
  return SE3{Eigen::Quaterniond::Identity(), p_imu_depth};
}

}  // namespace geoflow::drivers::d435i
