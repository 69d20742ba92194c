#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

/// USB configuration descriptors of video cameras with an IMU behind HID.
///
/// Sources: Universal Serial Bus 3.2, 9.6; USB Device Class Definition for Video Devices 1.5, 3.7
/// and 3.9; its "Frame Based Payload" 3.1; Device Class Definition for HID 1.11, 6.2.1.
namespace geoflow::drivers::d435i {

/// What a format's pixels are, of those that this driver streams.
enum class PixelCoding : std::uint8_t {
  kZ16,    ///< depth, 16 bits in depth units
  kYuyv,   ///< colour 4:2:2
  kOther,  ///< anything else that the camera offers
};

using Guid = std::array<std::byte, 16>;  ///< in wire order

/// One size of a format, with its frame intervals, the first one being the descriptor's.
struct UvcFrame {
  std::uint8_t index = 0;  ///< bFrameIndex
  int width = 0;           ///< [px]
  int height = 0;          ///< [px]
  std::vector<std::uint32_t> intervals_100ns;
};

struct UvcFormat {
  std::uint8_t index = 0;  ///< bFormatIndex
  Guid guid{};
  PixelCoding coding = PixelCoding::kOther;
  int bits_per_pixel = 0;
  std::vector<UvcFrame> frames;
};

/// A VideoStreaming interface: formats behind one endpoint.
struct StreamingInterface {
  std::uint8_t number = 0;           ///< bInterfaceNumber
  std::uint8_t endpoint = 0;         ///< bEndpointAddress of its video data
  std::uint16_t max_packet = 0;      ///< wMaxPacketSize of that endpoint
  bool bulk = false;                 ///< else isochronous
  std::uint8_t terminal_link = 0;    ///< the output terminal that it shows
  std::vector<UvcFormat> formats{};  ///< in the descriptor's order
};

struct ExtensionUnit {
  std::uint8_t id = 0;
  Guid guid{};
  std::vector<std::byte> controls;  ///< bit i of the whole: selector i + 1 exists

  [[nodiscard]] bool has(std::uint8_t selector) const noexcept;
};

/// A VideoControl interface.
struct ControlInterface {
  std::uint8_t number = 0;
  std::uint16_t uvc_version = 0;          ///< bcdUVC: 0x0150 for 1.5
  std::vector<std::uint8_t> streaming{};  ///< numbers of its streaming interfaces
  std::vector<ExtensionUnit> extension_units{};
};

struct HidInterface {
  std::uint8_t number = 0;
  std::uint8_t endpoint = 0;  ///< interrupt IN
  std::uint16_t max_packet = 0;
  std::uint16_t report_descriptor_bytes = 0;
};

/// What a configuration descriptor says of a camera.
struct UsbDescription {
  std::uint8_t configuration = 0;  ///< bConfigurationValue
  std::vector<ControlInterface> controls{};
  std::vector<StreamingInterface> streams{};
  std::optional<HidInterface> hid{};
};

/// Reads a whole configuration descriptor (wTotalLength bytes). Descriptors of unknown type are
/// passed over. kInvalidData, naming the byte, where one is shorter than its kind or reaches over
/// the end. Pure; bounded by the input.
[[nodiscard]] Result<UsbDescription> parse_configuration(std::span<const std::byte> bytes);

/// The interface, format and frame that stream `coding` at that size and rate.
struct ModeChoice {
  std::uint8_t interface = 0;
  std::uint8_t endpoint = 0;
  std::uint8_t format_index = 0;
  std::uint8_t frame_index = 0;
  std::uint32_t interval_100ns = 0;
  std::uint32_t frame_bytes = 0;  ///< width x height x bytes a pixel
};

struct VideoMode {
  PixelCoding coding = PixelCoding::kOther;
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  int rate_hz = 0;

  friend bool operator==(const VideoMode&, const VideoMode&) = default;
};

/// Frames a second of an interval, rounded: 333333 -> 30, 1666665 -> 6. 0 for the interval 0.
[[nodiscard]] int rate_of(std::uint32_t interval_100ns) noexcept;

/// Every mode that this driver can stream, in the descriptor's order.
[[nodiscard]] std::vector<VideoMode> list_modes(const UsbDescription& description);

/// kNotFound, with the rates and sizes that there are, where the camera has no such mode on this
/// link; kInvalidData where its descriptors give that mode a size that no such camera has.
[[nodiscard]] Result<ModeChoice> choose_mode(const UsbDescription& description,
                                             const VideoMode& mode);

/// The words "848x480 at 30/60 Hz, …" for messages: the modes of one coding.
[[nodiscard]] std::string describe_modes(const std::vector<VideoMode>& modes, PixelCoding coding);

}  // namespace geoflow::drivers::d435i
