#include "src/steady_tiles.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "src/ray_scene.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kMargin_px = 1.5F;  // half a pixel of jitter, and one for what lies between rays
constexpr int kUnknown = -3;

/// What the valid lanes of a packet see if it is the same for all.
int common(const Valid& valid, const RayPacket& packet) {
  int seen = kUnknown;
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (valid[i] == 0) {
      continue;
    }
    int here = SteadyTiles::kMixed;
    if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
      here = SteadyTiles::kSky;
    } else if (packet.hit.geomID[i] == static_cast<unsigned>(HitKind::kPatch)) {
      here = static_cast<int>(packet.hit.primID[i]);
    }
    if (seen != kUnknown && seen != here) {
      return SteadyTiles::kMixed;
    }
    seen = here;
  }
  return seen;
}

}  // namespace

SteadyTiles::SteadyTiles(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter,
                         int width, const ViewTrack& track)
    : columns_{(width + kTile - 1) / kTile},
      rows_{(shutter.rows + kTile - 1) / kTile},
      centre_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      reach_(centre_.size()) {
  look(rays, pinhole, shutter, width, track);
  spread();
}

void SteadyTiles::look(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter,
                       int width, const ViewTrack& track) {
  const ViewTrack::Motion motion = track.largest_motion(0.5 * shutter.exposure_s);
  const float walk_m = rays.people_travel_m(0.5 * shutter.exposure_s);
  const float focal_px = 1.0F / std::min(pinhole.inverse_fx, pinhole.inverse_fy);
  for_each_tile(width, shutter.rows, [&](const Tile& tile) {
    RayPacket packet;
    RayScene::reset(packet);
    for (std::size_t row = 0; row < kTile; ++row) {
      const double t_s = shutter.row_mid_s(std::min(tile.y(kTile * row), shutter.rows - 1));
      const View view = track.at(t_s);
      for (std::size_t i = kTile * row; i < kTile * (row + 1); ++i) {
        aim(packet, i, view.p_world_cam,
            view.R_world_cam *
                pinhole.direction(static_cast<float>(tile.x(i)), static_cast<float>(tile.y(i))));
        packet.ray.time[i] = rays.ray_time(t_s);
      }
    }
    rays.trace(tile.valid, packet);
    float nearest_m = std::numeric_limits<float>::infinity();
    float shift_m = motion.shift_m;
    for (std::size_t i = 0; i < kPacket; ++i) {
      nearest_m = tile.valid[i] != 0 ? std::min(nearest_m, packet.ray.tfar[i]) : nearest_m;
      if (packet.hit.geomID[i] == static_cast<unsigned>(HitKind::kPerson)) {
        shift_m = motion.shift_m + walk_m;
      }
    }
    const Eigen::Vector3f corner =
        pinhole.direction(static_cast<float>(tile.left), static_cast<float>(tile.top));
    const float slant = corner.squaredNorm();
    const float reach_px =
        kMargin_px + focal_px * (slant * motion.turn_rad + std::sqrt(slant) * shift_m / nearest_m);
    const std::size_t here = index(tile.left / kTile, tile.top / kTile);
    const auto most = static_cast<float>(std::max(columns_, rows_));
    reach_[here] = static_cast<int>(std::min(most, std::ceil(reach_px / kTile)));
    centre_[here] = common(tile.valid, packet);
  });
}

void SteadyTiles::spread() {
  seen_.assign(centre_.size(), kUnknown);
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const std::size_t here = index(column, row);
      const int reach = reach_[here];
      if (column < reach || row < reach || column + reach >= columns_ || row + reach >= rows_) {
        seen_[here] = kMixed;
      }
      for (int y = std::max(0, row - reach); y <= std::min(rows_ - 1, row + reach); ++y) {
        for (int x = std::max(0, column - reach); x <= std::min(columns_ - 1, column + reach);
             ++x) {
          int& seen = seen_[index(x, y)];
          seen = seen == kUnknown || seen == centre_[here] ? centre_[here] : kMixed;
        }
      }
    }
  }
}

}  // namespace geoflow::simulator
