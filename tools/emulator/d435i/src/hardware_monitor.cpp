#include "src/hardware_monitor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/calibration_tables.hpp"

namespace geoflow::emulator {
namespace {

constexpr std::uint16_t kMagic = 0xcdab;
constexpr std::size_t kCommandHeader = 24;
constexpr std::size_t kUncounted = 4;  // length and magic
constexpr std::size_t kMostData = 1000;
constexpr std::size_t kLengthAt = kMonitorSize - 4;

enum class Opcode : std::uint32_t {
  kReadRegister = 0x01,
  kReadLogs = 0x0f,
  kIdentity = 0x10,
  kTable = 0x15,
  kRestart = 0x20,
  kGetAdvanced = 0x2c,
  kEnableAdvanced = 0x2d,
  kIsAdvanced = 0x30,
  kSetDepthRegion = 0x44,
  kGetDepthRegion = 0x45,
  kMotionMemory = 0x4f,
  kSetSynchronisation = 0x69,
  kGetSynchronisation = 0x6a,
  kSetColorRegion = 0x75,
  kGetColorRegion = 0x76,
  kSubpresetId = 0x7d,
  kRectifiedSizes = 0x7e,
  kLaserAlwaysOn = 0x7f,
};

enum Error : std::int32_t {
  kWrongCommand = -1,
  kWrongParameter = -6,
  kNoSuchTable = -17,
  kNoData = -21,
};

/// Registers of the device clock: its address, and the one behind it.
constexpr std::uint32_t kClockRegister = 0x0001613c;
constexpr std::uint32_t kClockRegisterEnd = 0x00016140;

constexpr double kMicrometresPerMetre = 1e6;
constexpr std::int64_t kMicrometresPerMillimetre = 1000;

template <typename Integer>
Integer read(std::span<const std::byte> bytes, std::size_t offset) {
  std::uint64_t value = 0;
  for (std::size_t i = sizeof(Integer); i-- > 0;) {
    constexpr unsigned kByteBits = 8;
    value = (value << kByteBits) | std::to_integer<std::uint64_t>(bytes[offset + i]);
  }
  return static_cast<Integer>(value);
}

/// Pairs of hexadecimal digits as bytes.
void put_serial(const std::string& digits, std::size_t offset, Bytes& to) {
  constexpr std::size_t kSerialSize = 6;
  constexpr int kHexadecimal = 16;
  for (std::size_t i = 0; i < kSerialSize; ++i) {
    to[offset + i] =
        static_cast<std::byte>(std::stoi(digits.substr(2 * i, 2), nullptr, kHexadecimal));
  }
}

Bytes region_bytes(std::span<const std::uint16_t> region) {
  const auto bytes = std::as_bytes(region);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

struct HardwareMonitor::Command {
  Opcode opcode{};
  std::array<std::uint32_t, 4> parameters{};
};

// NOLINTBEGIN(readability-magic-numbers): offsets of librealsense's d400-private.h, each named
Bytes identity(const D435iOptions& options) {
  constexpr std::size_t kSize = 256;
  Bytes data(kSize);
  const auto set = [&](std::size_t offset, unsigned value) {
    data[offset] = static_cast<std::byte>(value);
  };
  set(0, 2);  // structure version
  set(12, options.firmware.build);
  set(13, options.firmware.patch);
  set(14, options.firmware.minor);
  set(15, options.firmware.major);
  set(25, 1);  // locked
  put_serial(options.module_serial, 48, data);
  put_serial(options.asic_serial, 64, data);
  set(112, 0xff);  // no fisheye
  set(113, 0xff);
  set(124, 0x1f);  // BMI085
  set(166, 2);     // global shutter
  set(170, 1);     // projector
  set(174, 1);     // colour
  set(178, 1);     // IMU
  return data;
}
// NOLINTEND(readability-magic-numbers)

HardwareMonitor::HardwareMonitor(const D435iOptions& options, const Calibration& calibration)
    : options_{options},
      calibration_{calibration},
      // Only advanced mode can say a unit of depth other than a millimetre.
      advanced_{std::lround(calibration.depth_unit_m * kMicrometresPerMetre) !=
                kMicrometresPerMillimetre},
      reply_(kMonitorSize) {
  const auto bottom = static_cast<std::uint16_t>(calibration.camera.height - 1);
  const auto right = static_cast<std::uint16_t>(calibration.camera.width - 1);
  depth_region_ = {0, bottom, 0, right};
  color_region_ = depth_region_;
}

HardwareMonitor::Answer HardwareMonitor::table(std::uint32_t id) const {
  constexpr std::uint32_t kDepthTable = 25;
  constexpr std::uint32_t kColorTable = 32;
  switch (id) {
    case kDepthTable:
      return {.data = depth_table(calibration_.camera)};
    case kColorTable:
      return {.data = color_table(calibration_.camera)};
    default:
      return {.error = kNoSuchTable};
  }
}

HardwareMonitor::Answer HardwareMonitor::motion_memory(std::uint32_t offset,
                                                       std::uint32_t size) const {
  if (!calibration_.T_cam_imu) {
    return {.error = kNoData};
  }
  const Bytes whole = motion_table(calibration_.T_cam_imu->inverse());
  if (offset > whole.size() || size > whole.size() - offset) {
    return {.error = kWrongParameter};
  }
  const auto begin = whole.begin() + static_cast<std::ptrdiff_t>(offset);
  return {.data = Bytes(begin, begin + static_cast<std::ptrdiff_t>(size))};
}

HardwareMonitor::Answer HardwareMonitor::advanced(std::uint32_t group, std::uint32_t mode) const {
  constexpr std::uint32_t kDepthTableControl = 9;
  constexpr std::uint32_t kMaximum = 2;
  constexpr std::uint32_t kFarthest = 65536;
  if (!advanced_ || group != kDepthTableControl || mode > kMaximum) {
    return {.error = kWrongParameter};
  }
  ByteWriter to;
  to.u32(static_cast<std::uint64_t>(std::lround(calibration_.depth_unit_m * kMicrometresPerMetre)));
  to.u32(0).u32(kFarthest).u32(0).u32(0);  // nearest, farthest, disparity: multiplier, shift
  return {.data = to.take()};
}

HardwareMonitor::Answer HardwareMonitor::answer(const Command& command, std::uint64_t device_us) {
  const auto& p = command.parameters;
  const auto region_of = [&] {
    Region region{};
    std::ranges::transform(p, region.begin(),
                           [](std::uint32_t value) { return static_cast<std::uint16_t>(value); });
    return region;
  };
  switch (command.opcode) {
    case Opcode::kReadRegister:
      if (p[0] != kClockRegister || p[1] != kClockRegisterEnd) {
        return {.error = kWrongParameter};
      }
      return {.data = ByteWriter{}.u32(device_us).take()};
    case Opcode::kIdentity:
      return {.data = identity(options_)};
    case Opcode::kTable:
      return table(p[0]);
    case Opcode::kRestart:
      restart_ = true;
      return {};
    case Opcode::kGetAdvanced:
      return advanced(p[0], p[1]);
    case Opcode::kEnableAdvanced:
      advanced_ = p[0] != 0;
      return {};
    case Opcode::kIsAdvanced:
      return {.data = ByteWriter{}.u8(advanced_ ? 1 : 0).take()};
    case Opcode::kSetDepthRegion:
      depth_region_ = region_of();
      return {};
    case Opcode::kGetDepthRegion:
      return {.data = region_bytes(depth_region_)};
    case Opcode::kSetColorRegion:
      color_region_ = region_of();
      return {};
    case Opcode::kGetColorRegion:
      return {.data = region_bytes(color_region_)};
    case Opcode::kMotionMemory:
      return motion_memory(p[0], p[1]);
    case Opcode::kSetSynchronisation:
      synchronisation_ = p[0];
      return {};
    case Opcode::kGetSynchronisation:
      return {.data = ByteWriter{}.put(synchronisation_).take()};
    case Opcode::kSubpresetId:
      return {.error = kNoData};
    case Opcode::kRectifiedSizes:
      return {.data = rectified_sizes(calibration_.camera)};
    case Opcode::kReadLogs:
    case Opcode::kLaserAlwaysOn:
      return {};
  }
  return {.error = kWrongCommand};
}

void HardwareMonitor::request(std::span<const std::byte> bytes, std::uint64_t device_us) {
  Answer answered{.error = kWrongCommand};
  std::uint32_t opcode = 0;
  if (bytes.size() == kMonitorSize && read<std::uint16_t>(bytes, 2) == kMagic) {
    const std::size_t length = read<std::uint16_t>(bytes, 0);
    opcode = read<std::uint32_t>(bytes, 4);
    if (length + kUncounted < kCommandHeader || length + kUncounted > kCommandHeader + kMostData) {
      answered.error = kWrongParameter;
    } else {
      constexpr std::size_t kParametersAt = 8;
      Command command{.opcode = static_cast<Opcode>(opcode)};
      for (std::size_t i = 0; i < command.parameters.size(); ++i) {
        command.parameters[i] =
            read<std::uint32_t>(bytes, kParametersAt + i * sizeof(std::uint32_t));
      }
      answered = answer(command, device_us);
    }
  }
  ByteWriter reply;
  reply.put(answered.error != 0 ? static_cast<std::uint32_t>(answered.error) : opcode);
  reply.bytes(answered.data).pad_to(kLengthAt).u32(answered.data.size());
  reply_ = reply.take();
}

bool HardwareMonitor::take_restart() noexcept {
  return std::exchange(restart_, false);
}

}  // namespace geoflow::emulator
