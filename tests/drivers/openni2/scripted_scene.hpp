#pragma once

#include <cstddef>
#include <cstdint>

/// What the scripted camera of the test module shows: the module and its test both know it.
namespace geoflow::drivers::openni2::tests {

inline constexpr const char* kSerial = "850123050307";
inline constexpr std::uint32_t kDepthPeriod = 9000;

/// Depth [mm] of a pixel in frame `number`, 500 to 9499.
[[nodiscard]] constexpr std::uint16_t depth_mm(std::uint32_t number, std::size_t pixel) noexcept {
  constexpr std::size_t kNearest_mm = 500;
  constexpr std::size_t kPixelStep = 7;
  constexpr std::size_t kFrameStep = 31;
  return static_cast<std::uint16_t>(kNearest_mm +
                                    (pixel * kPixelStep + number * kFrameStep) % kDepthPeriod);
}

/// A byte of YUYV in frame `number`.
[[nodiscard]] constexpr std::uint8_t yuyv_byte(std::uint32_t number, std::size_t index) noexcept {
  constexpr std::size_t kLarge = 2654435761;
  constexpr unsigned kUpper = 13;
  return static_cast<std::uint8_t>(((index + 1) * kLarge >> kUpper) + number);
}

}  // namespace geoflow::drivers::openni2::tests
