#include "storage/bytes.hpp"

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "geoflow/hal/geometry.hpp"

namespace geoflow::slam {
namespace {

/// SE3 normalises what it is made of, which may change the last bit once or twice: this is what it
/// does not change any more.
SE3 settled(const SE3& pose) {
  constexpr int kAtMost = 8;
  SE3 before = pose;
  for (int i = 0; i < kAtMost; ++i) {
    const SE3 after{before.rotation(), before.translation()};
    if (after.rotation().coeffs() == before.rotation().coeffs()) {
      break;
    }
    before = after;
  }
  return before;
}

}  // namespace

void ByteWriter::put(const Vector2d& value) {
  put(value.x());
  put(value.y());
}

void ByteWriter::put(const Vector3d& value) {
  put(value.x());
  put(value.y());
  put(value.z());
}

void ByteWriter::put(const Matrix6d& value) {
  for (const double entry : value.reshaped<Eigen::RowMajor>()) {
    put(entry);
  }
}

void ByteWriter::put(const SE3& value) {
  const SE3 stable = settled(value);
  put(stable.translation());
  put(stable.rotation().x());
  put(stable.rotation().y());
  put(stable.rotation().z());
  put(stable.rotation().w());
}

void ByteWriter::put(std::string_view text) {
  text = text.substr(0, kLongestText);
  put_count(text.size());
  for (const char c : text) {
    put(static_cast<std::uint8_t>(c));
  }
}

void ByteReader::fail(std::string_view what) {
  if (wrong_.empty()) {
    wrong_ = what;
  }
}

double ByteReader::f64() {
  const auto value = std::bit_cast<double>(get<std::uint64_t>());
  if (!std::isfinite(value)) {
    fail("a number is not finite");
    return 0;
  }
  return value;
}

float ByteReader::f32() {
  const auto value = std::bit_cast<float>(u32());
  if (!std::isfinite(value)) {
    fail("a number is not finite");
    return 0;
  }
  return value;
}

Vector2d ByteReader::vector2() {
  const double x = f64();
  return {x, f64()};
}

Vector3d ByteReader::vector3() {
  const double x = f64();
  const double y = f64();
  return {x, y, f64()};
}

Matrix6d ByteReader::matrix6() {
  Matrix6d matrix;
  for (double& entry : matrix.reshaped<Eigen::RowMajor>()) {
    entry = f64();
  }
  return matrix;
}

SE3 ByteReader::pose() {
  constexpr double kRounding = 1e-6;
  constexpr double kFarthestM = 1e7;  // beyond, a double's millimetres become uncertain in products
  const Vector3d translation = vector3();
  const double x = f64();
  const double y = f64();
  const double z = f64();
  const double w = f64();
  const Eigen::Quaterniond rotation{w, x, y, z};
  if (ok() && std::abs(rotation.norm() - 1) > kRounding) {
    fail("a rotation is not one");
  }
  if (translation.cwiseAbs().maxCoeff() > kFarthestM) {
    fail("a pose is out of any range");
  }
  return ok() ? SE3{rotation, translation} : SE3{};
}

std::string ByteReader::text() {
  const std::size_t length = count(1);
  if (length > kLongestText) {
    fail("a text is too long");
    return {};
  }
  std::string text;
  for (std::size_t i = 0; i < length; ++i) {
    text.push_back(static_cast<char>(get<std::uint8_t>()));
  }
  return text;
}

std::size_t ByteReader::count(std::size_t least_entry_bytes) {
  const std::size_t entries = u32();
  if (entries > left() / least_entry_bytes) {
    fail("a list is longer than what is there");
    return 0;
  }
  return entries;
}

}  // namespace geoflow::slam
