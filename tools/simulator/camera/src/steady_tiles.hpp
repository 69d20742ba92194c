#pragma once

#include <cstddef>
#include <limits>
#include <vector>

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

/// Which tiles of an image see one patch and nothing else during a whole exposure. Their rays need
/// no tracing: they end where they meet the patch's plane.
///
/// One ray a pixel is traced at the middle of its row's exposure. Whatever is seen there stays
/// within its reach during the exposure: where the camera's motion, at the tile's nearest and
/// farthest depth, and a walker's own take it in the image. A tile is steady if all reaches that
/// touch it are of the same patch. Beyond the image anything may be, but nothing nearer than the
/// nearest that the image shows. What is
/// thinner than a pixel may be missed, as it may be by any pixel's rays.
class SteadyTiles {
 public:
  static constexpr int kMixed = -1;
  static constexpr int kSky = -2;

  SteadyTiles(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter, int width,
              const ViewTrack& track);

  /// The patch that all of a tile's rays meet, or kSky, or kMixed.
  [[nodiscard]] int at(const Tile& tile) const noexcept {
    return seen_[index(tile.left / kTile, tile.top / kTile)];
  }

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
  };
  /// What a tile sees lies between the two, and moves by itself by `walk_m`.
  struct Depths {
    float nearest_m = std::numeric_limits<float>::infinity();
    float farthest_m = 0;
    float walk_m = 0;
  };
  /// Where a row of tiles looks during its exposure.
  struct Glance {
    double mid_s = 0;
    View middle;
    std::vector<View> others;
  };
  void look(const RayScene& rays, const Shutter& shutter, int width);
  [[nodiscard]] Reach reach(int column, int row, const Depths& depths) const;
  void mark(int column, int row, const Reach& reach, int seen);

  int columns_;
  int rows_;
  Pinhole pinhole_;
  float walk_m_;                 ///< how far people move during half the exposure
  std::vector<Glance> glances_;  ///< of each row of tiles
  std::vector<Depths> depths_;   ///< of each tile
  std::vector<int> centre_;      ///< what each tile sees in the middle of its exposure
  std::vector<int> seen_;
};

}  // namespace geoflow::simulator
