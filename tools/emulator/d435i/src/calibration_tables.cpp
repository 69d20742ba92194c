#include "src/calibration_tables.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/checksum.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/image_packer.hpp"
#include "src/image_view.hpp"
#include "src/stream_table.hpp"

namespace geoflow::emulator {
namespace {

constexpr std::size_t kHeaderSize = 16;
constexpr double kMillimetresPerMetre = 1000.0;

struct TableHeader {
  std::uint16_t version = 0;  ///< as its two bytes read, the first one first
  std::uint16_t type = 0;
};

/// Table `content`, zeros up to `size` bytes in all, behind its header.
Bytes with_header(const TableHeader& header, ByteWriter content, std::size_t size) {
  constexpr unsigned kByteBits = 8;
  content.pad_to(size - kHeaderSize);
  ByteWriter table;
  table.u8(header.version >> kByteBits)
      .put(static_cast<std::uint8_t>(header.version))
      .put(header.type);
  table.u32(size - kHeaderSize).u32(0).put(crc32(content.view()));
  return table.bytes(content.view()).take();
}

/// Anything of numbers, in its own order (Eigen's: column by column), as float.
template <typename Matrix>
void put_matrix(ByteWriter& to, const Matrix& matrix) {
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    to.put(static_cast<float>(matrix.data()[i]));
  }
}

/// The camera matrix for image coordinates from -1 to 1.
Matrix3d normalised_matrix(const CameraIntrinsics& camera) {
  Matrix3d matrix = Matrix3d::Identity();
  matrix(0, 0) = 2.0 * camera.fx / camera.width;
  matrix(1, 1) = 2.0 * camera.fy / camera.height;
  matrix(0, 2) = 2.0 * camera.cx / camera.width - 1.0;
  matrix(1, 2) = 2.0 * camera.cy / camera.height - 1.0;
  return matrix;
}

void put_focal_and_centre(ByteWriter& to, const CameraIntrinsics& camera) {
  to.put(static_cast<float>(camera.fx)).put(static_cast<float>(camera.fy));
  to.put(static_cast<float>(camera.cx)).put(static_cast<float>(camera.cy));
}

}  // namespace

Bytes depth_table(const CameraIntrinsics& source) {
  using Size = std::pair<int, int>;
  constexpr std::array<Size, 10> kSizes{{{1920, 1080},
                                         {1280, 720},
                                         {640, 480},
                                         {848, 480},
                                         {640, 360},
                                         {424, 240},
                                         {320, 240},
                                         {480, 270},
                                         {1280, 800},
                                         {960, 540}}};
  constexpr Size kImager{1280, 800};
  constexpr std::size_t kSize = 512;
  constexpr std::size_t kRectifiedAt = 256 - kHeaderSize;
  const Matrix3d matrix = normalised_matrix(view_of(source, kImager.first, kImager.second));
  ByteWriter content;
  put_matrix(content, matrix);
  put_matrix(content, matrix);
  put_matrix(content, Matrix3d{Matrix3d::Identity()});
  put_matrix(content, Matrix3d{Matrix3d::Identity()});
  content.put(static_cast<float>(-kBaselineM * kMillimetresPerMetre)).u32(0);  // no distortion
  content.pad_to(kRectifiedAt);
  for (const auto& [width, height] : kSizes) {
    put_focal_and_centre(content, view_of(source, width, height));
  }
  constexpr TableHeader kHeader{.version = 0x0100, .type = 25};
  return with_header(kHeader, std::move(content), kSize);
}

Bytes color_table(const CameraIntrinsics& source) {
  constexpr std::size_t kSize = 256;
  constexpr int kDistortionCoefficients = 5;
  const Matrix3d matrix = normalised_matrix(source);
  Eigen::Matrix<double, 3, 4> projection = Eigen::Matrix<double, 3, 4>::Zero();
  projection.leftCols<3>() = matrix;
  ByteWriter content;
  put_matrix(content, matrix);
  put_matrix(content, Eigen::VectorXd{Eigen::VectorXd::Zero(kDistortionCoefficients)});
  put_matrix(content, Vector3d{Vector3d::Zero()});  // rotation
  put_matrix(content, Vector3d{Vector3d::Zero()});  // translation
  put_matrix(content, projection);
  content.u16(static_cast<unsigned>(source.width)).u16(static_cast<unsigned>(source.height));
  put_matrix(content, matrix);
  put_matrix(content, Matrix3d{Matrix3d::Identity()});  // rectified rotation and translation
  put_matrix(content, Vector3d{Vector3d::Zero()});
  constexpr TableHeader kHeader{.version = 0x0100, .type = 32};
  return with_header(kHeader, std::move(content), kSize);
}

Bytes motion_table(const SE3& T_imu_cam) {
  constexpr std::size_t kSize = 520;
  constexpr std::size_t kFlagsAt = 48 - kHeaderSize;
  ByteWriter content;
  content.pad_to(kFlagsAt);
  content.u8(1).u8(0).u16(0);  // place known, own calibration not
  put_matrix(content, T_imu_cam.rotation_matrix());
  put_matrix(content, T_imu_cam.translation());
  constexpr TableHeader kHeader{.version = 0x0101, .type = 0};
  return with_header(kHeader, std::move(content), kSize);
}

Bytes rectified_sizes(const CameraIntrinsics& source) {
  ByteWriter to;
  for (const FrameSize& size : video_interfaces()[0].formats[0].sizes) {
    to.put(size.width).put(size.height);
    put_focal_and_centre(to, view_of(source, size.width, size.height));
  }
  return to.take();
}

}  // namespace geoflow::emulator
