#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "src/ray_scene.hpp"
#include "src/steady_tiles.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {

/// What rays are sent through a pixel and how many.
struct Sampling {
  int rays_a_pixel = 1;
  std::uint64_t key = 0;   ///< decides how they spread over a pixel and its exposure
  bool trace_all = false;  ///< do without SteadyTiles: to test them
};

/// Sends the rays of an exposure: each of a pixel's rays has a part of the exposure of its own, and
/// a stratum of its own in x and in y. Const and thread-safe.
class Sender {
 public:
  Sender(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter,
         const ViewTrack& track, const Sampling& sampling);

  /// How the camera moves during one part of a row of tiles' exposure.
  struct Leg {
    View begin;
    View change;        ///< to the end
    float begin_s = 0;  ///< after the shutter's begin
    float inverse_span = 0;
  };
  /// The legs of the row of tiles that begins at pixel row `top`, part by part.
  [[nodiscard]] std::vector<Leg> legs(int top) const;

  /// Random bits of each of a tile's pixels, for all parts of its exposure.
  using PixelBits = std::array<std::uint32_t, kPacket>;
  [[nodiscard]] PixelBits pixel_bits(const Tile& tile) const;

  /// Aims a packet's rays of part `part`, and says which number each has in an order of its pixel's
  /// rays.
  void aim_tile(const Tile& tile, const PixelBits& pixels, int part, const Leg& leg,
                RayPacket& packet, std::array<int, kPacket>& order) const;

 private:
  Pinhole pinhole_;
  Shutter shutter_;
  const ViewTrack* track_;
  Sampling sampling_;
  float ray_time_begin_;
  float ray_time_per_s_;
};

/// Lets a packet's rays end on a plane: {x : normal . x = height}.
void land(unsigned patch, const Eigen::Vector3f& normal, float height, RayPacket& packet);

}  // namespace geoflow::simulator
