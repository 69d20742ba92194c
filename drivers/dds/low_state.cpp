#include "dds/low_state.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

#include "replay/cdr/cursor.hpp"

namespace geoflow::drivers::dds {
namespace {

constexpr std::size_t kJointCount = kLegCount * kJointsPerLeg;
constexpr std::size_t kMostPadding = 3;  // behind a message that ends within a word

/// Lays values out as a C compiler does: each aligned to its size, a struct to its largest member.
/// What is between them stays zero.
class MemoryWriter {
 public:
  explicit MemoryWriter(std::span<std::byte> bytes) noexcept : bytes_{bytes} {}

  template <cdr::Scalar T>
  void write(T value) {
    static_assert(std::endian::native == std::endian::little);
    const auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
    align(sizeof(T));
    std::ranges::copy(raw, bytes_.begin() + static_cast<std::ptrdiff_t>(at_));
    at_ += sizeof(T);
  }
  template <cdr::Composite T>
  void write(const T& value) {
    align(alignof(T));
    std::apply([this](const auto&... member) { (this->write(member), ...); }, T::fields(value));
    align(alignof(T));
  }
  template <typename T, std::size_t Size>
  void write(const std::array<T, Size>& values) {
    for (const T& value : values) {
      write(value);
    }
  }

 private:
  void align(std::size_t alignment) noexcept {
    at_ = (at_ + alignment - 1) / alignment * alignment;
  }

  std::span<std::byte> bytes_;
  std::size_t at_ = 0;
};

static_assert(sizeof(LowState) == kMemoryBytes && alignof(LowState) == sizeof(std::uint32_t));

constexpr std::uint32_t kPolynomial = 0x04C11DB7;
constexpr std::size_t kTableSize = 256;
constexpr unsigned kTopByte = 24;  // its place in the register, in bits

/// What one byte in the top of the register does to it.
constexpr std::array<std::uint32_t, kTableSize> make_table() {
  std::array<std::uint32_t, kTableSize> table{};
  for (std::size_t byte = 0; byte < kTableSize; ++byte) {
    auto value = static_cast<std::uint32_t>(byte << kTopByte);
    for (int bit = 0; bit < 8; ++bit) {
      value = value << 1U ^ ((value >> 31U) != 0 ? kPolynomial : 0U);
    }
    table[byte] = value;
  }
  return table;
}

Vector3d vector(const std::array<float, 3>& values) {
  return Eigen::Vector3f{values.data()}.cast<double>();
}

}  // namespace

Result<LowState> decode(std::span<const std::byte> cdr) {
  cdr::Reader reader{cdr};
  LowState state;
  reader.read(state);
  if (reader.error()) {
    return fail(ErrorCode::kInvalidData, "LowState: {}", *reader.error());
  }
  if (reader.remaining() > kMostPadding) {
    return fail(ErrorCode::kInvalidData, "LowState: {} bytes are left over behind the message",
                reader.remaining());
  }
  return state;
}

std::vector<std::byte> encode(const LowState& state) {
  cdr::Writer writer;
  writer.write(state);
  return std::move(writer).take();
}

std::array<std::byte, kMemoryBytes> memory_image(const LowState& state) {
  std::array<std::byte, kMemoryBytes> image{};
  MemoryWriter{image}.write(state);
  return image;
}

std::uint32_t checksum(const LowState& state) {
  static constexpr auto kTable = make_table();
  const auto image = memory_image(state);
  std::uint32_t crc = ~std::uint32_t{0};
  const std::size_t end = image.size() - sizeof(state.crc);
  for (std::size_t word = 0; word < end; word += sizeof(std::uint32_t)) {
    for (std::size_t i = sizeof(std::uint32_t); i > 0; --i) {  // words from their top byte on
      const auto byte = std::to_integer<std::uint32_t>(image[word + i - 1]);
      crc = crc << 8U ^ kTable[crc >> kTopByte ^ byte];
    }
  }
  return crc;
}

Result<LegSample> legs_of(const LowState& state) {
  LegSample sample;
  for (std::size_t i = 0; i < kJointCount; ++i) {
    const MotorState& motor = state.motor_state[i];
    if (!std::isfinite(motor.q) || !std::isfinite(motor.dq) || !std::isfinite(motor.tau_est)) {
      return fail(ErrorCode::kInvalidData, "LowState: motor {} has a value that is no number", i);
    }
    sample.joints[i] = {.q_rad = static_cast<double>(motor.q),
                        .dq_radps = static_cast<double>(motor.dq),
                        .tau_nm = static_cast<double>(motor.tau_est)};
  }
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    sample.foot_force[leg] = static_cast<float>(state.foot_force[leg]);
    sample.valid[leg] = true;
  }
  return sample;
}

Result<ImuSample> imu_of(const LowState& state) {
  ImuSample sample{.accel_mps2 = vector(state.imu_state.accelerometer),
                   .gyro_radps = vector(state.imu_state.gyroscope)};
  if (!sample.accel_mps2.allFinite() || !sample.gyro_radps.allFinite()) {
    return fail(ErrorCode::kInvalidData, "LowState: the IMU has a value that is no number");
  }
  return sample;
}

}  // namespace geoflow::drivers::dds
