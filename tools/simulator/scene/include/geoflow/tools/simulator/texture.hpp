#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"

namespace geoflow::simulator {

/// The luminance of linear sRGB primaries (ITU-R BT.709).
[[nodiscard]] inline float luminance(const Rgb& colour) noexcept {
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

  /// Points on the surface, and the size of what a ray sees there.
  struct Spots {
    Lanes u_m{};
    Lanes v_m{};
    Lanes footprint_m{};
  };
  /// The reflectance about each spot, averaged over about its footprint: bilinear in one of the two
  /// levels around that size. `dither` in 0 … 1 decides which: the mean over evenly spread ones is
  /// linear between the levels, 0.5 takes the nearer one. u and v must be within 1e6 sides.
  void sample(const Spots& spots, float dither, LaneColours& out) const noexcept;

  /// Standard deviation of the luminance over its mean, of the structure between `footprint_m` and
  /// 8 times that size: what a window of about 8 x 8 pixels sees of the texture.
  [[nodiscard]] float contrast(float footprint_m) const noexcept;

 private:
  static constexpr std::size_t kMostLevels = 16;

  [[nodiscard]] float level_of(float footprint_m) const noexcept;
  void place(const Spots& spots, Lanes& u, Lanes& v) const noexcept;
  void turn(Lanes& u, Lanes& v) const noexcept;
  void find_taps(const Lanes& u, const Lanes& v, const Lanes& level, Taps& taps) const noexcept;

  float length_m_;
  float inverse_length_;
  Repeat repeat_;
  int side_;
  int last_level_ = 0;
  Rgb unit_{};  ///< reflectance of a texel's masked bits, as numbers
  Rgb mean_{};
  std::vector<std::uint32_t> texels_;               ///< level after level, 8 bits each of r, g, b
  std::array<std::uint32_t, kMostLevels> first_{};  ///< of each level in texels_
  std::vector<float> contrasts_;
};

}  // namespace geoflow::simulator
