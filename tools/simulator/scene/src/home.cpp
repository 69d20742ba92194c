#include <numbers>
#include <utility>
#include <vector>

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

constexpr float kHeight_m = 2.5F;
constexpr float kDoorWidth_m = 1.1F;
constexpr float kDoorHeight_m = 2.05F;
constexpr float kThickness_m = 0.12F;

/// A wall between two rooms from the builder's origin along x, `kThickness_m` thick about y = 0,
/// with openings whose middles stand at `doors`.
void add_partition(Builder builder, float length_m, const std::vector<float>& doors, int wall,
                   int frame) {
  const float half = 0.5F * kThickness_m;
  const auto piece = [&](float from, float to, float bottom) {
    builder.box({from, -half, bottom}, {to, half, kHeight_m}, wall);
    builder.quad({from, -half, bottom}, {0, kThickness_m, 0}, {to - from, 0, 0}, wall);
  };
  float from = 0;
  for (const float door : doors) {
    piece(from, door - 0.5F * kDoorWidth_m, 0);
    piece(door - 0.5F * kDoorWidth_m, door + 0.5F * kDoorWidth_m, kDoorHeight_m);
    for (const float side : {-1.0F, 1.0F}) {
      const float x = door + side * (0.5F * kDoorWidth_m + 0.03F);
      builder.box({x - 0.03F, -half - 0.02F, 0}, {x + 0.03F, half + 0.02F, kDoorHeight_m}, frame);
    }
    from = door + 0.5F * kDoorWidth_m;
  }
  piece(from, length_m, 0);
}

/// Sofa, low table on a rug, television, shelf; `size` is the room's, its corner at the origin.
void furnish_living_room(Builder builder, const Vector2f& size, const FurnitureMaterials& m,
                         Random random) {
  const Room walls{.size_m = {size.x(), size.y(), kHeight_m}};
  const int rug = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_pattern(Rgb{0.35F, 0.12F, 0.1F, 0}, random.fork("rug")),
                                  2.0F, Repeat::kClamp)});
  const Vector3f middle{0.5F * size.x(), 0.5F * size.y(), 0};
  builder.quad(middle + Vector3f{-0.95F, -0.7F, 0.008F}, {1.9F, 0, 0}, {0, 1.4F, 0}, rug);
  add_table(builder.at(middle), {0.9F, 0.5F, 0.42F}, m);
  const Builder west = wall_of(builder, walls, Side::kWest);
  add_sofa(west.at({0.5F * size.y() - 0.95F, -0.04F, 0}), 1.9F, m);
  add_poster(west, {0.5F * size.y() - 0.5F, 0, 1.2F}, 1.0F, random.fork("painting"));
  Builder south = wall_of(builder, walls, Side::kSouth);
  add_cabinet(south.at({0.5F * size.x() - 0.8F, 0, 0}), {1.6F, 0.42F, 0.5F}, m.wood, m);
  south.box({0.5F * size.x() - 0.55F, -0.3F, 0.55F}, {0.5F * size.x() + 0.55F, -0.24F, 1.2F},
            m.glass);
  add_plant(south.at({0.4F, -0.4F, 0}), 1.3F, m, random.fork("plant"));
  add_bookshelf(south.at({size.x() - 1.3F, 0, 0}), 0.9F, m);
  add_window(west.at({0.3F, 0, 0}), 1.1F, 2500.0F, m);
}

/// Counters along two walls, a table with chairs in the middle.
void furnish_kitchen(const Builder& builder, const Vector2f& size, const FurnitureMaterials& m,
                     Random random) {
  const Room walls{.size_m = {size.x(), size.y(), kHeight_m}};
  Builder east = wall_of(builder, walls, Side::kEast);
  const float counter = size.y() - 0.1F;
  for (float x = 0.05F; x + 0.6F <= counter; x += 0.6F) {
    add_cabinet(east.at({x, 0, 0}), {0.6F, 0.58F, 0.86F}, m.white, m);
  }
  east.box({0.03F, -0.62F, 0.86F}, {counter, 0, 0.9F}, m.wood);
  east.box({0.03F, -0.35F, 1.45F}, {counter, 0, 2.1F}, m.white);
  Builder south = wall_of(builder, walls, Side::kSouth);
  south.box({0.7F, -0.62F, 0}, {1.35F, 0, 1.8F}, m.metal);
  add_poster(south, {size.x() - 1.4F, 0, 1.1F}, 0.7F, random.fork("calendar"));
  const Builder table = builder.at({0.5F * size.x() - 0.2F, 0.5F * size.y(), 0});
  add_table(table, {0.8F, 0.8F, 0.74F}, m);
  constexpr float kQuarter = 0.5F * std::numbers::pi_v<float>;
  for (int side = 0; side < 4; ++side) {
    if (random.chance(0.75F)) {
      add_chair(table.at(Vector3f::Zero(), kQuarter * static_cast<float>(side))
                    .at({random.uniform(-0.05F, 0.05F), 0.32F, 0}),
                m);
    }
  }
}

/// Along the hall's outer wall: shoes, a chest, pictures, coats.
void furnish_hall(const Builder& builder, const Vector2f& size, const FurnitureMaterials& m,
                  Random random) {
  const Room walls{.size_m = {size.x(), size.y(), kHeight_m}};
  Builder north = wall_of(builder, walls, Side::kNorth);
  add_skirting(north, size.x(), m.white);
  float x = random.uniform(0.3F, 0.6F);
  while (x + 1.2F < size.x()) {
    const int kind = random.index(4);
    if (kind == 0) {
      add_door(north.at({x, 0, 0}), m);
    } else if (kind == 1) {
      add_cabinet(north.at({x, 0, 0}), {0.9F, 0.3F, 0.8F}, m.wood, m);
    } else if (kind == 2) {
      add_poster(north, {x, 0, random.uniform(0.7F, 1.0F)}, 0.7F, Random{random.bits()});
      north.box({x + 0.1F, -0.28F, 0}, {x + 0.35F, -0.02F, 0.1F}, m.dark_plastic);
    } else {
      for (int coat = 0; coat < 3; ++coat) {
        const float at = x + 0.3F * static_cast<float>(coat);
        north.box({at, -0.2F, 0.7F}, {at + 0.24F, -0.03F, 1.6F},
                  coat % 2 == 0 ? m.fabric : m.cushion);
      }
    }
    x += random.uniform(1.3F, 1.8F);
  }
}

/// Sizes [m]: two rooms side by side below, and the hall over both.
struct Plan {
  float living_x;
  float kitchen_x;
  float rooms_y;
  float hall_y;
};

/// Where the doors' middles are [m]: x of those to the hall, y of that between the rooms.
struct Doors {
  float living;
  float kitchen;
  float between;
};

void light_rooms(const Builder& builder, const Plan& plan) {
  const auto& [living_x, kitchen_x, rooms_y, hall_y] = plan;
  for (const auto& [corner, size] :
       {std::pair{Vector3f{0, 0, 0}, Vector3f{living_x, rooms_y, kHeight_m}},
        {Vector3f{living_x, 0, 0}, Vector3f{kitchen_x, rooms_y, kHeight_m}},
        {Vector3f{0, rooms_y, 0}, Vector3f{living_x + kitchen_x, hall_y, kHeight_m}}}) {
    add_ceiling_lamps(builder.at(corner), size,
                      {.lux = 180,
                       .spacing_m = {5, 5},
                       .size_m = {0.5F, 0.5F},
                       .colour = Rgb{1.0F, 0.88F, 0.72F, 0}});
  }
}

void walk_round(const Builder& builder, const Plan& plan, const Doors& doors) {
  // Round: hall, living room, kitchen, hall.
  const auto point = [](float x, float y) {
    return Vector2d{static_cast<double>(x), static_cast<double>(y)};
  };
  const float hall = plan.rooms_y + 0.5F * plan.hall_y - 0.12F;
  const float above = plan.rooms_y - 0.78F;
  const float before_door = plan.living_x - 0.75F;
  const float behind_door = plan.living_x + 0.65F;
  builder.scene().waypoints = {point(doors.living, hall),         point(doors.living, above),
                               point(before_door, above),         point(before_door, doors.between),
                               point(behind_door, doors.between), point(behind_door, above),
                               point(doors.kitchen, above),       point(doors.kitchen, hall),
                               point(doors.living, hall)};
  builder.scene().closed = true;
}

}  // namespace

void lay_out_home(Builder builder, Random random) {
  const FurnitureMaterials m = make_furniture_materials(builder, random.fork("materials"));
  const float living_x = random.uniform(4.6F, 5.4F);
  const float kitchen_x = random.uniform(4.2F, 4.8F);
  const float rooms_y = random.uniform(4.3F, 4.9F);
  const float hall_y = random.uniform(1.7F, 2.0F);
  const float total_x = living_x + kitchen_x;
  const Plan plan{
      .living_x = living_x, .kitchen_x = kitchen_x, .rooms_y = rooms_y, .hall_y = hall_y};
  const Rgb oak{0.42F, 0.27F, 0.15F, 0};
  const TileStyle tiles{.colour = Rgb{0.5F, 0.48F, 0.45F, 0},
                        .joint = grey(0.25F),
                        .count = 4,
                        .joint_fraction = 0.02F,
                        .variation = 0.03F};
  const int planks = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_planks(oak, 8, random.fork("planks")), 1.4F),
       .reflectivity = 0.02F,
       .roughness = 0.03F});
  const int tiled =
      builder.material({.albedo = grey(1),
                        .texture = builder.texture(paint_tiles(tiles, random.fork("tiles")), 1.2F),
                        .reflectivity = 0.03F,
                        .roughness = 0.02F});
  const Rgb tint{random.uniform(0.6F, 0.75F), random.uniform(0.6F, 0.72F),
                 random.uniform(0.5F, 0.7F), 0};
  const int wall = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_plaster(tint, random.fork("wall")), 1.5F)});
  const Room shell{.size_m = {total_x, rooms_y + hall_y, kHeight_m},
                   .floor = planks,
                   .wall = wall,
                   .ceiling = builder.paint(grey(0.78F))};
  add_room(builder, shell);
  builder.quad({living_x, 0, 0.002F}, {kitchen_x, 0, 0}, {0, rooms_y, 0}, tiled);

  // Rooms below, the hall above; a door from each room to the hall and one between the rooms.
  const float living_door = 0.5F * living_x;
  const float kitchen_door = living_x + 0.45F * kitchen_x - 0.3F;
  constexpr float kQuarter = 0.5F * std::numbers::pi_v<float>;
  add_partition(builder.at({0, rooms_y, 0}), total_x, {living_door, kitchen_door}, wall, m.white);
  const float between = 0.5F * rooms_y + 0.2F;
  const Builder upright = builder.at({living_x, 0, 0}, kQuarter);
  add_partition(upright, rooms_y, {between}, wall, m.white);

  furnish_living_room(builder, {living_x, rooms_y}, m, random.fork("living room"));
  furnish_kitchen(builder.at({living_x, 0, 0}), {kitchen_x, rooms_y}, m, random.fork("kitchen"));
  furnish_hall(builder.at({0, rooms_y, 0}), {total_x, hall_y}, m, random.fork("hall"));
  light_rooms(builder, plan);
  const float hall = rooms_y + 0.5F * hall_y - 0.12F;
  walk_round(builder, plan, {.living = living_door, .kitchen = kitchen_door, .between = between});
  add_pedestrians(builder, {{{1.0F, hall}, {total_x - 1.0F, hall}}}, 0, random.fork("people"));
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
