#include "src/steady_tiles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "geoflow/tools/simulator/scene.hpp"

#include "src/candidates.hpp"
#include "src/outlines.hpp"
#include "src/ray_scene.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

// Half a pixel of jitter, half for what moves otherwise than the tile's middle, and three because
// a corner of something may stick out between rays four pixels apart, or its outline be a little
// off.
constexpr float kMargin_px = 4.0F;
constexpr float kMost_px = 1e4F;
constexpr float kFlattest = 0.1F;  // of a view's direction, off its axis
constexpr float kBehind = 1.02F;   // an outline farther than that is behind what a tile sees
// Moments of an exposure, from its middle.
constexpr std::array<double, 4> kShares{-0.5, -0.25, 0.25, 0.5};

}  // namespace

SteadyTiles::SteadyTiles(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter,
                         int width, const ViewTrack& track)
    : columns_{(width + kTile - 1) / kTile},
      rows_{(shutter.rows + kTile - 1) / kTile},
      pinhole_{pinhole},
      walk_m_{rays.people().travel_m(0.5 * shutter.exposure_s)},
      moves_{shutter.exposure_s > 0},
      anything_{columns_ + 1, rows_ + 1},
      anyone_{columns_ + 1, rows_ + 1},
      depths_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      people_(depths_.size()),
      centre_(depths_.size()),
      seen_(depths_.size()) {
  for (int row = 0; row < rows_; ++row) {
    const double mid_s = shutter.row_mid_s(std::min(row * kTile + kTile / 2, shutter.rows - 1));
    middles_.push_back(track.at(mid_s));
    Glances glances;
    for (const double share : kShares) {
      glances.push_back(track.at(mid_s + share * shutter.exposure_s));
    }
    glances_.push_back(glances);
  }
  join_corners(look_at_corners(rays));
  add_outlines(rays);
  add_people(rays);
  spread();
  spread_people();
}

int SteadyTiles::at(const Tile& tile) const noexcept {
  const Candidates& may = candidates(tile);
  if (may.none()) {
    return kSky;
  }
  return may.one_patch() ? static_cast<int>(may.patches().front()) : kMixed;
}

std::vector<SteadyTiles::Sight> SteadyTiles::look_at_corners(const RayScene& rays) const {
  const int across = columns_ + 1;
  std::vector<Sight> corners(static_cast<std::size_t>(across) *
                             static_cast<std::size_t>(rows_ + 1));
  // An image of a pixel a corner.
  for_each_tile(across, rows_ + 1, [&](const Tile& tile) {
    RayPacket packet;
    RayScene::reset(packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const int row = std::min(tile.y(i), rows_ - 1);
      const View& view = middles_[static_cast<std::size_t>(row)];
      aim(packet, i, view.p_world_cam,
          view.R_world_cam * pinhole_.direction(static_cast<float>(tile.x(i) * kTile) - 0.5F,
                                                static_cast<float>(tile.y(i) * kTile) - 0.5F));
    }
    rays.trace_static(tile.valid, packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (tile.valid[i] == 0) {
        continue;
      }
      Sight& sight =
          corners[static_cast<std::size_t>(tile.y(i)) * static_cast<std::size_t>(across) +
                  static_cast<std::size_t>(tile.x(i))];
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
        sight.seen.add_nothing();
        continue;
      }
      sight.depth_m = packet.ray.tfar[i];
      if (packet.hit.geomID[i] == static_cast<unsigned>(HitKind::kPatch)) {
        sight.seen.add_patch(packet.hit.primID[i]);
      } else {
        sight.seen.add_anything();
      }
    }
  });
  return corners;
}

void SteadyTiles::join_corners(const std::vector<Sight>& corners) {
  const auto across = static_cast<std::size_t>(columns_) + 1;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const std::size_t here = index(column, row);
      const std::size_t first = here + static_cast<std::size_t>(row);
      for (const std::size_t corner : {first, first + 1, first + across, first + across + 1}) {
        centre_[here].add(corners[corner].seen);
        depths_[here].add(corners[corner].depth_m);
      }
    }
  }
}

void SteadyTiles::add_outlines(const RayScene& rays) {
  const Scene& scene = rays.scene();
  const Outlines outlines{pinhole_, middles_, columns_};
  std::vector<Outlines::Crossing> crossings;
  const auto see = [&](const auto& add) {
    for (const auto& [tile, depth_m] : crossings) {
      Depths& depths = depths_[tile];
      if (depth_m <= kBehind * depths.farthest_m) {
        depths.nearest_m = std::min(depths.nearest_m, depth_m);
        add(tile);
      }
    }
    crossings.clear();
  };
  for (std::size_t patch = 0; patch < scene.patches.size(); ++patch) {
    outlines.of(scene.patches[patch], crossings);
    see([&](std::size_t tile) { centre_[tile].add_patch(static_cast<std::uint32_t>(patch)); });
  }
  for (const Capsule& capsule : scene.capsules) {
    outlines.of(capsule, 0, crossings);
    see([&](std::size_t tile) { centre_[tile].add_anything(); });
  }
}

void SteadyTiles::add_people(const RayScene& rays) {
  const Outlines outlines{pinhole_, middles_, columns_};
  std::vector<Outlines::Crossing> crossings;
  for (const Capsule& limb : rays.people().limbs()) {
    outlines.of(limb, rays.people().travel_m(), crossings);
    for (const auto& [tile, depth_m] : crossings) {
      if (depth_m <= kBehind * depths_[tile].farthest_m) {
        people_[tile].add(depth_m);
        people_[tile].walk_m = walk_m_;
      }
    }
    crossings.clear();
  }
}

void SteadyTiles::spread() {
  Depths beyond{.nearest_m = std::numeric_limits<float>::infinity(),
                .farthest_m = std::numeric_limits<float>::infinity(),
                .walk_m = walk_m_};
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const std::size_t here = index(column, row);
      beyond.nearest_m =
          std::min({beyond.nearest_m, depths_[here].nearest_m, people_[here].nearest_m});
    }
    mark_row(row, 0, columns_ - 1, [&](int column) {
      const std::size_t here = index(column, row);
      return Spread{.reach = reach(column, row, depths_[here]), .seen = centre_[here]};
    });
  }
  Candidates anything;
  anything.add_anything();
  for (int row = -1; moves_ && row <= rows_; ++row) {
    const auto from_beyond = [&](int column) {
      return Spread{.reach = reach(column, row, beyond), .seen = anything};
    };
    if (row < 0 || row == rows_) {
      mark_row(row, -1, columns_, from_beyond);
    } else {
      mark_row(row, -1, -1, from_beyond);
      mark_row(row, columns_, columns_, from_beyond);
    }
  }
  for_each_covered(anything_, [](Candidates& seen) { seen.add_anything(); });
}

void SteadyTiles::spread_people() {
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Depths& people = people_[index(column, row)];
      if (people.seen()) {
        anyone_.add(within(row, column, column, reach(column, row, people)));
      }
    }
  }
  for_each_covered(anyone_, [](Candidates& seen) { seen.add_people(); });
}

template <typename SpreadOf>
void SteadyTiles::mark_row(int row, int first, int last, const SpreadOf& spread_of) {
  int begin = first;
  Spread common = spread_of(first);
  for (int column = first + 1; column <= last; ++column) {
    const Spread here = spread_of(column);
    if (!(here == common)) {
      mark(row, begin, column - 1, common);
      begin = column;
      common = here;
    }
  }
  mark(row, begin, last, common);
}

SteadyTiles::Reach SteadyTiles::reach(int column, int row, const Depths& depths) const {
  float left = 0;
  float right = 0;
  float up = 0;
  float down = 0;
  if (moves_) {
    const float middle = 0.5F * static_cast<float>(kTile - 1);
    const Vector3f direction = pinhole_.direction(static_cast<float>(column * kTile) + middle,
                                                  static_cast<float>(row * kTile) + middle);
    const auto held_row = static_cast<std::size_t>(std::clamp(row, 0, rows_ - 1));
    const View& from = middles_[held_row];
    for (const View& other : glances_[held_row]) {
      const Eigen::Matrix3f to_other = other.R_world_cam.transpose();
      const Vector3f turned = to_other * Vector3f{from.R_world_cam * direction};
      const Vector3f shift = to_other * Vector3f{from.p_world_cam - other.p_world_cam};
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
  }
  const float walk_px = depths.walk_m / depths.nearest_m / pinhole_.inverse_fx;
  const auto tiles = [&](float px) {
    return static_cast<int>(std::ceil(std::min(kMost_px, px + walk_px + kMargin_px) / kTile));
  };
  return {.left = tiles(left), .right = tiles(right), .up = tiles(up), .down = tiles(down)};
}

void SteadyTiles::mark(int row, int first, int last, const Spread& spread) {
  const Rectangle reached = within(row, first, last, spread.reach);
  if (reached.empty()) {
    return;
  }
  if (spread.seen.anything()) {
    // Whatever else these tiles may see does not matter; their sum is taken once.
    anything_.add(reached);
    return;
  }
  for (int y = reached.top; y <= reached.bottom; ++y) {
    for (int x = reached.left; x <= reached.right; ++x) {
      seen_[index(x, y)].add(spread.seen);
    }
  }
}

SteadyTiles::Rectangle SteadyTiles::within(int row, int first, int last, const Reach& reach) const {
  return {.left = std::max(0, first - reach.left),
          .right = std::min(columns_ - 1, last + reach.right),
          .top = std::max(0, row - reach.up),
          .bottom = std::min(rows_ - 1, row + reach.down)};
}

template <typename Add>
void SteadyTiles::for_each_covered(Cover& cover, const Add& add) {
  for (int y = 0; y < rows_; ++y) {
    int along = 0;
    for (int x = 0; x < columns_; ++x) {
      along += cover.at(x, y);
      int& sum = cover.at(x, y);
      sum = along + (y > 0 ? cover.at(x, y - 1) : 0);
      if (sum > 0) {
        add(seen_[index(x, y)]);
      }
    }
  }
}

}  // namespace geoflow::simulator
