#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "src/candidates.hpp"
#include "src/ray_scene.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {

/// When each row of a rolling shutter is open.
struct Shutter {
  double t_mid_s = 0;  ///< the middle of the middle row's exposure
  double exposure_s = 0;
  double readout_s = 0;
  int rows = 0;

  [[nodiscard]] double row_mid_s(int row) const noexcept {
    return t_mid_s +
           readout_s * ((static_cast<double>(row) + 0.5) / static_cast<double>(rows) - 0.5);
  }
  [[nodiscard]] double begin_s() const noexcept { return t_mid_s - 0.5 * (exposure_s + readout_s); }
  [[nodiscard]] double end_s() const noexcept { return t_mid_s + 0.5 * (exposure_s + readout_s); }
};

/// What the tiles of an image may see during a whole exposure: most of them one patch or a few.
/// Their rays need no tracing: they end where they meet the nearest of those.
///
/// In the middle of its row's exposure, a tile may see what rays through its corners meet, and
/// whatever has an outline in it that is not behind all of that. It stays within its reach during
/// the exposure: where the camera's motion, at the tile's nearest and farthest depth, and a
/// walker's own take it in the image. What a tile may see is what has it in reach. People are
/// looked for apart from what stands still behind them. Round things are left to tracing. Beyond
/// the image anything may be, but nothing nearer than the nearest that the image shows. What comes
/// out from behind something and is not seen before in its neighbourhood may be missed.
class SteadyTiles {
 public:
  static constexpr int kMixed = -1;
  static constexpr int kSky = -2;

  SteadyTiles(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter, int width,
              const ViewTrack& track);

  /// What a tile's rays may meet.
  [[nodiscard]] const Candidates& candidates(const Tile& tile) const noexcept {
    return seen_[index(tile.left / kTile, tile.top / kTile)];
  }
  /// The patch that all of a tile's rays meet, or kSky, or kMixed.
  [[nodiscard]] int at(const Tile& tile) const noexcept;

 private:
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
  /// From one tile, in tiles.
  struct Reach {
    int left = 0;
    int right = 0;
    int up = 0;
    int down = 0;
    [[nodiscard]] bool operator==(const Reach&) const = default;
  };
  /// What has a tile in it, and how far.
  struct Spread {
    Reach reach;
    Candidates seen;
    [[nodiscard]] bool operator==(const Spread&) const = default;
  };
  /// What a tile sees lies between the two, and moves by itself by `walk_m`. Nothing is farther
  /// than it is near.
  struct Depths {
    float nearest_m = std::numeric_limits<float>::infinity();
    float farthest_m = 0;
    float walk_m = 0;

    void add(float depth_m) noexcept {
      nearest_m = std::min(nearest_m, depth_m);
      farthest_m = std::max(farthest_m, depth_m);
    }
    [[nodiscard]] bool seen() const noexcept { return nearest_m <= farthest_m; }
  };
  /// Tiles of the image, ends included; none if it ends before it begins.
  struct Rectangle {
    int left = 0;
    int right = 0;
    int top = 0;
    int bottom = 0;
    [[nodiscard]] bool empty() const noexcept { return right < left || bottom < top; }
  };
  /// A number for each tile and for one more row and column: how many rectangles cover it, as
  /// differences between neighbours (Crow, "Summed-area tables for texture mapping", 1984).
  class Cover {
   public:
    Cover(int columns, int rows)
        : columns_{columns},
          counts_(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows)) {}
    void add(const Rectangle& covered) noexcept {
      at(covered.left, covered.top) += 1;
      at(covered.right + 1, covered.top) -= 1;
      at(covered.left, covered.bottom + 1) -= 1;
      at(covered.right + 1, covered.bottom + 1) += 1;
    }
    [[nodiscard]] int& at(int column, int row) noexcept {
      return counts_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                     static_cast<std::size_t>(column)];
    }

   private:
    int columns_;
    std::vector<int> counts_;
  };
  /// What one ray meets.
  struct Sight {
    Candidates seen;
    float depth_m = std::numeric_limits<float>::infinity();
  };
  /// Where a row of tiles looks at some moments of its exposure.
  using Glances = std::vector<View>;

  [[nodiscard]] std::vector<Sight> look_at_corners(const RayScene& rays) const;
  void join_corners(const std::vector<Sight>& corners);
  void add_outlines(const RayScene& rays);
  void add_people(const RayScene& rays);
  void spread();
  void spread_people();
  [[nodiscard]] Reach reach(int column, int row, const Depths& depths) const;
  /// Spreads what `spread_of(column)` says of a row's tiles `first` to `last`, equal neighbours
  /// together.
  template <typename SpreadOf>
  void mark_row(int row, int first, int last, const SpreadOf& spread_of);
  /// Adds what tiles `first` to `last` of a row all have in them to the tiles in their reach.
  void mark(int row, int first, int last, const Spread& spread);
  /// The tiles of the image that tiles `first` to `last` of a row reach.
  [[nodiscard]] Rectangle within(int row, int first, int last, const Reach& reach) const;
  /// Calls `add` with all tiles that a rectangle covers.
  template <typename Add>
  void for_each_covered(Cover& cover, const Add& add);

  int columns_;
  int rows_;
  Pinhole pinhole_;
  float walk_m_;                    ///< how far people move during half the exposure
  bool moves_;                      ///< is there time for anything to move in?
  Cover anything_;                  ///< of what may see anything
  Cover anyone_;                    ///< of what may see people
  std::vector<View> middles_;       ///< of each row of tiles, in the middle of its exposure
  std::vector<Glances> glances_;    ///< of each row of tiles
  std::vector<Depths> depths_;      ///< of each tile: of what stands still
  std::vector<Depths> people_;      ///< likewise of people; of none, not seen()
  std::vector<Candidates> centre_;  ///< what each tile may see in the middle of its exposure
  std::vector<Candidates> seen_;
};

}  // namespace geoflow::simulator
