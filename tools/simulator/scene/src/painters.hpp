#pragma once

#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/canvas.hpp"

/// The pictures on surfaces. Each takes a random generator of its own; pictures that tile do so
/// without a seam. Reflectances are linear and of the order of the material's measured ones.
namespace geoflow::simulator {

[[nodiscard]] Canvas paint_carpet(const Rgb& colour, Random random);
[[nodiscard]] Canvas paint_concrete(float reflectance, Random random);
[[nodiscard]] Canvas paint_planks(const Rgb& colour, int planks, Random random);
[[nodiscard]] Canvas paint_wood(const Rgb& colour, Random random);
/// Nearly uniform, as a painted wall: 1 % of unevenness.
[[nodiscard]] Canvas paint_plaster(const Rgb& colour, Random random);
/// `count` x `count` equal tiles with joints; all tiles look alike but for `variation` of their
/// brightness.
struct TileStyle {
  Rgb colour{};
  Rgb joint{};
  int count = 2;
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  float joint_fraction = 0.02F;  ///< of a tile's side
  float variation = 0;
};
[[nodiscard]] Canvas paint_tiles(const TileStyle& style, Random random);
/// Courses of bricks, each half a brick further.
[[nodiscard]] Canvas paint_bricks(const Rgb& colour, Random random);
/// A printed sheet: blocks, discs and lines of text.
[[nodiscard]] Canvas paint_poster(Random random);
/// Rows of books on boards.
[[nodiscard]] Canvas paint_books(Random random);
/// Windows of a computer's screen.
[[nodiscard]] Canvas paint_screen(Random random);
/// Rows of windows of a building.
[[nodiscard]] Canvas paint_facade(const Rgb& wall, Random random);
[[nodiscard]] Canvas paint_foliage(Random random);
/// A ceiling of mineral-fibre boards in a metal grid.
[[nodiscard]] Canvas paint_ceiling(Random random);
/// A sheet of many small blobs, for rugs and fabric with a pattern.
[[nodiscard]] Canvas paint_pattern(const Rgb& ground, Random random);
/// A low-contrast cloud of stains, to lay over a floor.
[[nodiscard]] Canvas paint_stains(float amplitude, Random random);

}  // namespace geoflow::simulator
