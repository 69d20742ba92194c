#pragma once

#include <cstdint>

namespace geoflow::slam {

enum class KeyframeId : std::uint32_t {};
enum class PointId : std::uint32_t {};
/// A part of the map: keyframes whose poses are relative to one another in a known way. What one
/// part's coordinates are in another's is not known until a place seen in both ties them.
enum class PartId : std::uint32_t {};

/// How many keyframes lie between two, the later one counted.
[[nodiscard]] constexpr std::uint32_t ids_apart(KeyframeId a, KeyframeId b) noexcept {
  const auto x = static_cast<std::uint32_t>(a);
  const auto y = static_cast<std::uint32_t>(b);
  return x > y ? x - y : y - x;
}

}  // namespace geoflow::slam
