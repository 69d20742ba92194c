#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// UVC 1.5, table A-8.
enum class UvcRequest : std::uint8_t {
  kSetCur = 0x01,
  kGetCur = 0x81,
  kGetMin = 0x82,
  kGetMax = 0x83,
  kGetRes = 0x84,
  kGetLen = 0x85,
  kGetInfo = 0x86,
  kGetDef = 0x87,
};

/// UVC 1.5, 4.2.1.2: why the last request was refused.
enum class UvcError : std::uint8_t {
  kNone = 0,
  kNotReady = 1,
  kOutOfRange = 4,
  kInvalidUnit = 5,
  kInvalidControl = 6,
  kInvalidRequest = 7,
};

// Entities and selectors that others than the table of controls must know.
inline constexpr std::uint8_t kColorTerminal = 6;
inline constexpr std::uint8_t kColorProcessing = 7;
inline constexpr std::uint8_t kDepthProcessing = 2;
inline constexpr std::uint8_t kDepthExtension = 3;
inline constexpr std::uint8_t kProcessingGain = 0x04;
inline constexpr std::uint8_t kTerminalAutoExposureMode = 0x02;
inline constexpr std::uint8_t kTerminalAutoExposurePriority = 0x03;
inline constexpr std::uint8_t kTerminalExposure = 0x04;  ///< [100 us]
enum class DepthSelector : std::uint8_t {
  kHardwareMonitor = 0x01,
  kEmitter = 0x02,
  kExposure = 0x03,  ///< [us]
  kLaserPower = 0x04,
  kPreset = 0x06,
  kErrorReport = 0x07,
  kTemperatures = 0x09,
  kAutoExposure = 0x0b,
};

/// The controls of the camera's terminals and units: their ranges, and their values now. The
/// hardware monitor's content is not among them.
class UvcControls {
 public:
  UvcControls();

  /// A class request to `entity` of a VideoControl interface: the data stage of a GET, nothing in
  /// it after a SET; none: STALL, and last_error() says why.
  [[nodiscard]] std::optional<Bytes> request(const SetupPacket& setup,
                                             std::span<const std::byte> out);

  /// A control's value now; 0 where there is no such control.
  [[nodiscard]] std::int64_t value(std::uint8_t entity, std::uint8_t selector) const;
  [[nodiscard]] std::int64_t value(DepthSelector selector) const;
  void set(DepthSelector selector, std::int64_t value);

 private:
  struct Value;

  [[nodiscard]] std::optional<Bytes> get(const Value& control, UvcRequest request) const;
  [[nodiscard]] bool store(Value& control, std::span<const std::byte> out);
  [[nodiscard]] std::optional<Bytes> refuse(UvcError error);

  struct Value {
    std::size_t row = 0;  ///< in the table of controls
    Bytes bytes;
  };
  [[nodiscard]] Value* find(std::uint8_t entity, std::uint8_t selector);
  [[nodiscard]] const Value* find(std::uint8_t entity, std::uint8_t selector) const;

  std::vector<Value> values_;
  UvcError last_error_ = UvcError::kNone;
};

}  // namespace geoflow::emulator
