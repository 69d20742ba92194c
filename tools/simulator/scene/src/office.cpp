#include <numbers>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/furniture.hpp"
#include "src/layouts.hpp"
#include "src/painters.hpp"
#include "src/room.hpp"

// A layout is its measures in metres. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

constexpr float kDesk_m = 1.6F;
constexpr float kBlockDepth_m = 1.6F;  // two desks back to back
constexpr float kChairZone_m = 0.75F;
constexpr float kWalk_m = 0.75F;      // from the chairs' zone to the walked line
constexpr float kWallZone_m = 0.65F;  // furniture along the walls

/// `count` pairs of desks back to back from the origin along x, centred on y = 0, with chairs at
/// both sides.
void add_desk_block(const Builder& builder, int count, const FurnitureMaterials& m, Random random) {
  for (int i = 0; i < count; ++i) {
    for (const bool far_side : {false, true}) {
      const float x = kDesk_m * static_cast<float>(i);
      const Builder side = far_side ? builder.at({x + kDesk_m, 0, 0}, std::numbers::pi_v<float>)
                                    : builder.at({x, 0, 0});
      add_desk(side, m, Random{random.bits()});
      if (random.chance(0.85F)) {
        add_office_chair(side.at({random.uniform(0.6F, 1.0F),
                                  -0.5F * kBlockDepth_m - random.uniform(0.2F, 0.4F), 0}),
                         m, Random{random.bits()});
      }
    }
  }
}

/// Shelves, cabinets, plants, posters, a door and perhaps windows along one wall.
void furnish_wall(const Builder& wall, float length_m, const FurnitureMaterials& m, Random random) {
  add_skirting(wall, length_m, m.frame);
  float x = random.uniform(0.75F, 1.0F);
  const bool windows = random.chance(0.5F);
  while (x + 1.9F < length_m) {
    const int kind = random.index(6);
    if (kind == 0) {
      add_bookshelf(wall.at({x, 0, 0}), 1.2F, m);
    } else if (kind == 1) {
      const Builder cabinet = wall.at({x, 0, 0});
      add_cabinet(cabinet, {1.1F, 0.45F, random.uniform(0.8F, 1.3F)},
                  random.chance(0.5F) ? m.wood : m.laminate, m);
      add_poster(cabinet, {0.1F, 0, 1.4F}, 0.8F, Random{random.bits()});
    } else if (kind == 2) {
      add_plant(wall.at({x + 0.4F, -0.32F, 0}), random.uniform(1.0F, 1.6F), m,
                Random{random.bits()});
    } else if (kind == 3) {
      add_door(wall.at({x, 0, 0}), m);
      Builder bin = wall.at({x + 1.3F, -0.3F, 0});
      bin.box({-0.13F, -0.13F, 0}, {0.13F, 0.13F, 0.32F}, m.dark_plastic);
    } else if (kind == 4 && windows) {
      add_window(wall.at({x, 0, 0}), 1.5F, 900.0F, m);
      Builder heater = wall.at({x, 0, 0});
      heater.box({0.1F, -0.12F, 0.12F}, {1.4F, -0.03F, 0.68F}, m.white);
    } else {
      add_poster(wall, {x, 0, random.uniform(0.5F, 0.9F)}, random.uniform(0.6F, 1.0F),
                 Random{random.bits()});
      if (random.chance(0.4F)) {
        add_chair(wall.at({x + 0.5F, -0.3F, 0}), m);
      }
    }
    x += random.uniform(1.6F, 2.2F);
  }
}

}  // namespace

void lay_out_office(Builder builder, Random random) {
  const FurnitureMaterials m = make_furniture_materials(builder, random.fork("materials"));
  const int first = 2 + random.index(2);
  const int second = 2 + random.index(2);
  const float end = kWallZone_m + kWalk_m;
  const float aisle = 2.0F * kWalk_m + random.uniform(0.1F, 0.5F);
  const float x1 = end + random.uniform(0.6F, 0.8F);
  const float x2 = x1 + kDesk_m * static_cast<float>(first);
  const float x3 = x2 + aisle;
  const float x4 = x3 + kDesk_m * static_cast<float>(second);
  const float side = kChairZone_m + kWalk_m;
  const float middle = kWallZone_m + kWalk_m + side + 0.5F * kBlockDepth_m;

  const float hue = random.uniform(-0.3F, 0.3F);
  const Rgb carpet{0.16F * (1.0F + hue), 0.17F, 0.2F * (1.0F - hue), 0};
  const Room room{.size_m = {x4 + x1, 2.0F * middle, random.uniform(2.6F, 3.0F)},
                  .floor = builder.material(
                      {.albedo = grey(1),
                       .texture = builder.texture(paint_carpet(carpet, random.fork("carpet")), 0.5F,
                                                  Repeat::kShuffle)}),
                  .wall = builder.material(
                      {.albedo = grey(1),
                       .texture = builder.texture(
                           paint_plaster(Rgb{0.72F, 0.71F, 0.67F, 0}, random.fork("wall")), 1.5F)}),
                  .ceiling = builder.material(
                      {.albedo = grey(1),
                       .texture = builder.texture(paint_ceiling(random.fork("ceiling")), 1.2F)})};
  add_room(builder, room);
  add_ceiling_lamps(builder, room.size_m, {.lux = 400});
  for (const Side wall : {Side::kSouth, Side::kEast, Side::kNorth, Side::kWest}) {
    furnish_wall(wall_of(builder, room, wall), wall_length(room, wall), m, Random{random.bits()});
  }
  add_desk_block(builder.at({x1, middle, 0}), first, m, random.fork("first block"));
  add_desk_block(builder.at({x3, middle, 0}), second, m, random.fork("second block"));

  // A figure of eight round both blocks.
  const auto y_low = static_cast<double>(middle - 0.5F * kBlockDepth_m - side);
  const auto y_high = static_cast<double>(middle + 0.5F * kBlockDepth_m + side);
  const auto left = static_cast<double>(x1 - kWalk_m);
  const auto centre = static_cast<double>(0.5F * (x2 + x3));
  const auto right = static_cast<double>(x4 + kWalk_m);
  builder.scene().waypoints = {{left, y_low},    {centre, y_low}, {centre, y_high},
                               {right, y_high},  {right, y_low},  {centre, y_low},
                               {centre, y_high}, {left, y_high},  {left, y_low}};
  builder.scene().closed = true;
  add_pedestrians(builder,
                  {{{static_cast<float>(left), static_cast<float>(y_low)},
                    {static_cast<float>(right), static_cast<float>(y_low)}}},
                  0, random.fork("people"));
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
