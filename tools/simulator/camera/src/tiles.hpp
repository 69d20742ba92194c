#pragma once

#include <cstddef>

#include <tbb/parallel_for.h>

#include "src/ray_scene.hpp"

namespace geoflow::simulator {

inline constexpr int kTile = 4;  ///< a packet's rays are those of kTile x kTile pixels
static_assert(std::size_t{kTile} * kTile == kPacket);

/// One tile of an image: pixel (x, y) of lane i is (left + i % kTile, top + i / kTile) where
/// valid[i] is -1.
struct Tile {
  int left = 0;
  int top = 0;
  Valid valid{};

  [[nodiscard]] int x(std::size_t lane) const noexcept {
    return left + static_cast<int>(lane) % kTile;
  }
  [[nodiscard]] int y(std::size_t lane) const noexcept {
    return top + static_cast<int>(lane) / kTile;
  }
};

/// Takes a width x height image in rows of tiles, in parallel: `prepare(top)` is called for each
/// row of tiles, and what it returns for each tile of it.
template <typename Prepare>
void for_each_tile_row(int width, int height, const Prepare& prepare) {
  tbb::parallel_for(0, (height + kTile - 1) / kTile, [&](int row) {
    const auto visit = prepare(row * kTile);
    for (int left = 0; left < width; left += kTile) {
      Tile tile{.left = left, .top = row * kTile};
      for (std::size_t i = 0; i < kPacket; ++i) {
        tile.valid[i] = tile.x(i) < width && tile.y(i) < height ? -1 : 0;
      }
      visit(tile);
    }
  });
}

/// Calls `visit(tile)` for all tiles of a width x height image, rows of tiles in parallel.
template <typename Visit>
void for_each_tile(int width, int height, const Visit& visit) {
  for_each_tile_row(width, height, [&](int) { return [&](const Tile& tile) { visit(tile); }; });
}

}  // namespace geoflow::simulator
