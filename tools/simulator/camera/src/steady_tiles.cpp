#include "src/steady_tiles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "src/ray_scene.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

// Half a pixel of jitter, one for what lies between rays, half for what moves otherwise than the
// tile's middle.
constexpr float kMargin_px = 2.0F;
constexpr float kMost_px = 1e4F;
constexpr float kFlattest = 0.1F;  // of a view's direction, off its axis
constexpr int kUnknown = -3;
// Moments of an exposure, from its middle.
constexpr std::array<double, 4> kShares{-0.5, -0.25, 0.25, 0.5};

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
      pinhole_{pinhole},
      walk_m_{rays.people_travel_m(0.5 * shutter.exposure_s)},
      depths_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      centre_(depths_.size()),
      seen_(depths_.size(), kUnknown) {
  for (int row = 0; row < rows_; ++row) {
    const double mid_s = shutter.row_mid_s(std::min(row * kTile + kTile / 2, shutter.rows - 1));
    Glance glance{.mid_s = mid_s, .middle = track.at(mid_s), .others = {}};
    for (const double share : kShares) {
      glance.others.push_back(track.at(mid_s + share * shutter.exposure_s));
    }
    glances_.push_back(glance);
  }
  look(rays, shutter, width);
  Depths beyond{.nearest_m = std::numeric_limits<float>::infinity(),
                .farthest_m = std::numeric_limits<float>::infinity(),
                .walk_m = walk_m_};
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const std::size_t here = index(column, row);
      beyond.nearest_m = std::min(beyond.nearest_m, depths_[here].nearest_m);
      mark(column, row, reach(column, row, depths_[here]), centre_[here]);
    }
  }
  for (int row = -1; row <= rows_; ++row) {
    const bool edge = row < 0 || row == rows_;
    for (int column = -1; column <= columns_; column += edge ? 1 : columns_ + 1) {
      mark(column, row, reach(column, row, beyond), kMixed);
    }
  }
}

SteadyTiles::Reach SteadyTiles::reach(int column, int row, const Depths& depths) const {
  const float middle = 0.5F * static_cast<float>(kTile - 1);
  const Vector3f direction = pinhole_.direction(static_cast<float>(column * kTile) + middle,
                                                static_cast<float>(row * kTile) + middle);
  const Glance& glance = glances_[static_cast<std::size_t>(std::clamp(row, 0, rows_ - 1))];
  float left = 0;
  float right = 0;
  float up = 0;
  float down = 0;
  for (const View& other : glance.others) {
    const Eigen::Matrix3f to_other = other.R_world_cam.transpose();
    const Vector3f turned = to_other * Vector3f{glance.middle.R_world_cam * direction};
    const Vector3f shift = to_other * Vector3f{glance.middle.p_world_cam - other.p_world_cam};
    for (const float inverse_m : {1.0F / depths.nearest_m, 1.0F / depths.farthest_m}) {
      const Vector3f seen = turned + inverse_m * shift;
      const float z = std::max(seen.z(), kFlattest);
      const float dx = (seen.x() / z - direction.x()) / pinhole_.inverse_fx;
      const float dy = (seen.y() / z - direction.y()) / pinhole_.inverse_fy;
      left = std::max(left, -dx);
      right = std::max(right, dx);
      up = std::max(up, -dy);
      down = std::max(down, dy);
    }
  }
  const float walk_px = depths.walk_m / depths.nearest_m / pinhole_.inverse_fx;
  const auto tiles = [&](float px) {
    return static_cast<int>(std::ceil(std::min(kMost_px, px + walk_px + kMargin_px) / kTile));
  };
  return {.left = tiles(left), .right = tiles(right), .up = tiles(up), .down = tiles(down)};
}

void SteadyTiles::look(const RayScene& rays, const Shutter& shutter, int width) {
  for_each_tile(width, shutter.rows, [&](const Tile& tile) {
    const int row = tile.top / kTile;
    const Glance& glance = glances_[static_cast<std::size_t>(row)];
    RayPacket packet;
    RayScene::reset(packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      aim(packet, i, glance.middle.p_world_cam,
          glance.middle.R_world_cam *
              pinhole_.direction(static_cast<float>(tile.x(i)), static_cast<float>(tile.y(i))));
      packet.ray.time[i] = rays.ray_time(glance.mid_s);
    }
    rays.trace(tile.valid, packet);
    Depths depths;
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (tile.valid[i] != 0) {
        depths.nearest_m = std::min(depths.nearest_m, packet.ray.tfar[i]);
        depths.farthest_m = std::max(depths.farthest_m, packet.ray.tfar[i]);
      }
      if (packet.hit.geomID[i] == static_cast<unsigned>(HitKind::kPerson)) {
        depths.walk_m = walk_m_;
      }
    }
    const std::size_t here = index(tile.left / kTile, row);
    depths_[here] = depths;
    centre_[here] = common(tile.valid, packet);
  });
}

void SteadyTiles::mark(int column, int row, const Reach& reach, int seen) {
  const int bottom = std::min(rows_ - 1, row + reach.down);
  const int right = std::min(columns_ - 1, column + reach.right);
  for (int y = std::max(0, row - reach.up); y <= bottom; ++y) {
    for (int x = std::max(0, column - reach.left); x <= right; ++x) {
      int& known = seen_[index(x, y)];
      known = known == kUnknown || known == seen ? seen : kMixed;
    }
  }
}

}  // namespace geoflow::simulator
