#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace geoflow::simulator {

/// Linear red, green, blue and an unused fourth, for arithmetic on all at once.
using Rgb = float __attribute__((vector_size(16)));

/// The luminance of linear sRGB primaries (ITU-R BT.709).
[[nodiscard]] constexpr float luminance(const Rgb& colour) noexcept {
  constexpr float kRed = 0.2126F;
  constexpr float kGreen = 0.7152F;
  constexpr float kBlue = 0.0722F;
  return kRed * colour[0] + kGreen * colour[1] + kBlue * colour[2];
}

/// What the texture does beyond its first copy.
enum class Repeat : std::uint8_t {
  kTile,     ///< repeats exactly
  kShuffle,  ///< each copy is turned by 0, 90, 180 or 270 degrees at random, as carpet tiles are
             ///< laid
  kClamp,    ///< the edge goes on
};

/// A square image of reflectances with levels of halved resolution, for sampling without aliasing.
/// Read-only after construction, so shared by all threads.
class Texture {
 public:
  /// `pixels`: side * side linear reflectances in 0 … 1, row by row; side is a power of two.
  /// `length_m` is the length of a side on the surface.
  Texture(const std::vector<Rgb>& pixels, int side, float length_m, Repeat repeat);

  [[nodiscard]] float length_m() const noexcept { return length_m_; }
  [[nodiscard]] const Rgb& mean() const noexcept { return mean_; }

  /// The reflectance about a point (u, v) [m] on the surface, averaged over about `footprint_m`.
  /// Bilinear in the two levels around that size.
  [[nodiscard]] Rgb sample(float u_m, float v_m, float footprint_m) const noexcept;

  /// The same from the nearest level alone: for faint overlays and for mirror images, where steps
  /// between levels do not show.
  [[nodiscard]] Rgb sample_quickly(float u_m, float v_m, float footprint_m) const noexcept;

  /// Standard deviation of the luminance over its mean, of the structure between `footprint_m` and
  /// 8 times that size: what a window of about 8 x 8 pixels sees of the texture.
  [[nodiscard]] float contrast(float footprint_m) const noexcept;

 private:
  struct Level {
    int side = 0;
    std::vector<std::uint32_t> texels;  ///< 8 bits each of r, g, b in units of unit_
  };

  [[nodiscard]] Rgb bilinear(std::size_t level, float u, float v) const noexcept;
  [[nodiscard]] float level_of(float footprint_m) const noexcept;
  void turn(float& u, float& v) const noexcept;

  float length_m_;
  float inverse_length_;
  Repeat repeat_;
  Rgb unit_{};
  Rgb mean_{};
  std::vector<Level> levels_;
  std::vector<float> contrasts_;
};

}  // namespace geoflow::simulator
