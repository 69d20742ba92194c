#include <utility>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/furniture.hpp"
#include "src/layouts.hpp"
#include "src/painters.hpp"
#include "src/room.hpp"

// A layout is its measures in metres. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

/// A wall from the builder's origin along x, looking to -y, with skirting and doors far apart.
void add_wall(Builder builder, const Vector2f& size_m, int wall, const FurnitureMaterials& m,
              Random random) {
  builder.quad(Vector3f::Zero(), {size_m.x(), 0, 0}, {0, 0, size_m.y()}, wall);
  add_skirting(builder, size_m.x(), m.frame);
  float x = random.uniform(2.0F, 5.0F);
  while (x + 1.5F < size_m.x()) {
    add_door(builder.at({x, 0, 0}), m);
    if (random.chance(0.3F)) {
      builder.box({x + 1.1F, -0.01F, 1.45F}, {x + 1.28F, 0, 1.6F}, m.laminate);
    }
    x += random.uniform(5.0F, 9.0F);
  }
}

}  // namespace

void lay_out_corridor(Builder builder, Random random) {
  const FurnitureMaterials m = make_furniture_materials(builder, random.fork("materials"));
  const float width = random.uniform(2.1F, 2.7F);
  const float height = random.uniform(2.5F, 2.8F);
  const float first = random.uniform(18.0F, 24.0F);
  const float second = random.uniform(9.0F, 14.0F);
  const int wall = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_plaster(grey(0.8F), random.fork("wall")), 2.0F)});
  const int floor =
      builder.material({.albedo = grey(1),
                        .texture = builder.texture(
                            paint_plaster(Rgb{0.42F, 0.42F, 0.40F, 0}, random.fork("floor")), 1.4F),
                        .overlay = builder.texture(paint_stains(0.03F, random.fork("wear")), 3.7F),
                        .reflectivity = 0.03F,
                        .roughness = 0.015F});
  const int ceiling = builder.paint(grey(0.78F));

  // An L: along x, then along y at its right end. Lengths of walls seen from inside.
  constexpr float kQuarter = 1.5707963F;
  add_wall(builder.at({first, 0, 0}, 2.0F * kQuarter), {first, height}, wall, m,
           random.fork("south"));
  add_wall(builder.at({first, second, 0}, -kQuarter), {second, height}, wall, m,
           random.fork("east"));
  add_wall(builder.at({0, width, 0}), {first - width, height}, wall, m, random.fork("north"));
  add_wall(builder.at({first - width, width, 0}, kQuarter), {second - width, height}, wall, m,
           random.fork("west"));
  add_wall(builder.at({0, 0, 0}, kQuarter), {width, height}, wall, m, random.fork("start"));
  add_wall(builder.at({first - width, second, 0}), {width, height}, wall, m, random.fork("end"));
  const Vector3f size_first{first, width, height};
  const Vector3f size_second{width, second - width, height};
  for (const auto& [corner, size] : {std::pair{Vector3f{0, 0, 0}, size_first},
                                     {Vector3f{first - width, width, 0}, size_second}}) {
    Builder leg = builder.at(corner);
    const Vector3f x{size.x(), 0, 0};
    const Vector3f y{0, size.y(), 0};
    leg.quad(Vector3f::Zero(), x, y, floor);
    leg.quad({0, 0, height}, y, x, ceiling);
    add_ceiling_lamps(leg, size, {.lux = 220, .spacing_m = {4, 4}, .size_m = {0.6F, 0.6F}});
  }
  const auto centre = static_cast<double>(0.5F * width);
  const double corner_x = static_cast<double>(first) - centre;
  builder.scene().waypoints = {
      {1.2, centre}, {corner_x, centre}, {corner_x, static_cast<double>(second) - 1.2}};

  // They keep to their right.
  const float lane = 0.32F;
  const auto line = [&](float fraction) {
    const float y = fraction * width;
    return std::vector<Vector2f>{{1.0F, y}, {first - y, y}, {first - y, second - 1.0F}};
  };
  add_pedestrians(builder, {line(0.5F * lane + 0.06F), line(1.0F - 0.5F * lane - 0.06F)}, 3,
                  random.fork("people"));
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
