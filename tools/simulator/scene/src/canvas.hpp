#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/texture.hpp"

namespace geoflow::simulator {

/// A square picture of linear reflectances on which textures are painted. Coordinates are fractions
/// of a side; what leaves one side comes in at the opposite one, so that the picture tiles.
class Canvas {
 public:
  Canvas(int side, const Rgb& colour)
      : side_{side},
        pixels_(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), colour) {}

  [[nodiscard]] int side() const noexcept { return side_; }
  [[nodiscard]] const std::vector<Rgb>& pixels() const noexcept { return pixels_; }
  [[nodiscard]] Rgb& at(int x, int y) noexcept;

  /// Fills the rectangle from (x, y), `width` by `height`.
  void rectangle(float x, float y, float width, float height, const Rgb& colour);
  /// Fills a disc.
  void disc(float x, float y, float radius, const Rgb& colour);
  /// Multiplies all by 1 + amplitude * noise, where noise is fractal with `cells` cells a side at
  /// its coarsest, of deviation about 1 and `octaves` octaves. `stretch` > 1 makes it longer along
  /// v.
  struct Noise {
    int cells = 4;
    int octaves = 4;
    // NOLINTNEXTLINE(readability-magic-numbers): named by its member
    float amplitude = 0.1F;
    int stretch = 1;
  };
  void modulate(const Noise& noise, std::uint64_t key);
  /// Multiplies each pixel by 1 + amplitude * normal.
  void speckle(float amplitude, Random random);
  /// A crooked dark line from (x, y), as a crack.
  void crack(float x, float y, const Rgb& colour, Random random);
  /// Moves all values from their mean by the factor, within 0.005 … 0.95.
  void scale_contrast(float factor);

 private:
  int side_;
  std::vector<Rgb> pixels_;
};

/// Fractal value noise over (u, v) in 0 … 1, periodic, mean 0 and deviation about 1.
class FractalNoise {
 public:
  FractalNoise(const Canvas::Noise& noise, std::uint64_t key);
  [[nodiscard]] float operator()(float u, float v) const;

 private:
  struct Octave {
    int columns = 0;
    int rows = 0;
    std::vector<float> nodes;
    [[nodiscard]] float at(float u, float v) const;
  };
  std::vector<Octave> octaves_;
};

[[nodiscard]] inline Rgb grey(float value) {
  return Rgb{value, value, value, 0};
}

}  // namespace geoflow::simulator
