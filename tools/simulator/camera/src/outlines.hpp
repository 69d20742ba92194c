#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/tools/simulator/scene.hpp"

#include "src/view.hpp"

namespace geoflow::simulator {

/// Where the outlines of things lie in the tiles of an image whose rows are each taken from a view
/// of its own, as if nothing hid them. Const and thread-safe.
class Outlines {
 public:
  /// `row_views`: one of each row of tiles, which must outlive this.
  Outlines(const Pinhole& pinhole, std::span<const View> row_views, int columns);

  struct Crossing {
    std::size_t tile = 0;  ///< row by row
    float depth_m = 0;     ///< nearest there
  };
  /// Appends a tile every few pixels along a patch's edges: no tile is crossed that is not one of
  /// those or beside one.
  void of(const Patch& patch, std::vector<Crossing>& out) const;
  /// Appends all tiles that a capsule may be in which moves by up to `travel_m`.
  void of(const Capsule& capsule, float travel_m, std::vector<Crossing>& out) const;

 private:
  /// A place in the image [px] and one over its depth.
  struct Place {
    float x = 0;
    float y = 0;
    float inverse_m = 0;
  };
  [[nodiscard]] Place place(const Eigen::Vector3f& p_world) const;
  [[nodiscard]] int row_of(float y) const noexcept;
  void walk(const Eigen::Vector3f& from, const Eigen::Vector3f& to,
            std::vector<Crossing>& out) const;
  void fill(const Place& centre, float radius_px, std::vector<Crossing>& out) const;

  Pinhole pinhole_;
  std::span<const View> row_views_;
  int columns_;
};

}  // namespace geoflow::simulator
