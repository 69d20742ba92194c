#include "src/furniture.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/painters.hpp"

// Furniture is its measures in metres. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

int random_paint(Builder& builder, Random& random) {
  return builder.paint(Rgb{random.uniform(0.05F, 0.7F), random.uniform(0.05F, 0.6F),
                           random.uniform(0.05F, 0.6F), 0});
}

/// Books, boxes and cups on a surface of `size` whose low corner is `corner`.
void add_clutter(Builder& builder, const Vector3f& corner, const Vector2f& size, int count,
                 Random random) {
  for (int i = 0; i < count; ++i) {
    const Vector3f extent{random.uniform(0.06F, 0.28F), random.uniform(0.06F, 0.22F),
                          random.uniform(0.015F, 0.16F)};
    const Vector3f at = corner + Vector3f{random.uniform(0.15F, 0.85F) * size.x(),
                                          random.uniform(0.15F, 0.85F) * size.y(), 0};
    Builder turned = builder.at(at, random.uniform(-0.6F, 0.6F));
    if (random.chance(0.25F)) {
      turned.rod({0, 0, 0.03F}, {0, 0, 0.07F}, 0.04F, random_paint(builder, random));
    } else {
      turned.box(-0.5F * Vector3f{extent.x(), extent.y(), 0},
                 {0.5F * extent.x(), 0.5F * extent.y(), extent.z()}, random_paint(builder, random));
    }
  }
}

}  // namespace

FurnitureMaterials make_furniture_materials(Builder& builder, Random random) {
  const float warm = random.uniform(0.5F, 1.0F);
  const Rgb wood{0.40F, 0.22F + 0.06F * warm, 0.10F + 0.06F * warm, 0};
  const Rgb fabric{random.uniform(0.05F, 0.35F), random.uniform(0.05F, 0.3F),
                   random.uniform(0.08F, 0.4F), 0};
  FurnitureMaterials m;
  m.wood =
      builder.material({.texture = builder.texture(paint_wood(wood, random.fork("wood")), 0.9F)});
  builder.scene().materials.back().albedo = grey(1);
  m.laminate = builder.paint(grey(random.uniform(0.45F, 0.75F)));
  m.metal = builder.material({.albedo = grey(0.35F), .reflectivity = 0.15F, .roughness = 0.05F});
  m.dark_plastic = builder.material({.albedo = grey(0.035F), .ir_reflectance = 0.06F});
  m.white = builder.paint(grey(0.78F));
  m.fabric = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_carpet(fabric, random.fork("fabric")), 0.5F)});
  m.cushion = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_pattern(fabric, random.fork("cushion")), 0.6F)});
  m.books = builder.material(
      {.albedo = grey(1), .texture = builder.texture(paint_books(random.fork("books")), 1.6F)});
  m.foliage =
      builder.material({.albedo = grey(1),
                        .texture = builder.texture(paint_foliage(random.fork("leaves")), 0.5F),
                        .ir_reflectance = 0.45F});
  m.glass =
      builder.material({.albedo = grey(0.03F), .reflectivity = 0.08F, .ir_reflectance = 0.02F});
  m.door = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_wood(1.3F * wood, random.fork("door")), 1.1F)});
  m.frame = builder.paint(grey(random.uniform(0.25F, 0.55F)));
  return m;
}

void add_desk(Builder builder, const FurnitureMaterials& m, Random random) {
  const float height = random.uniform(0.71F, 0.75F);
  builder.box({0, -0.8F, height - 0.03F}, {1.6F, 0, height},
              random.chance(0.5F) ? m.wood : m.laminate);
  builder.quad({0, -0.8F, height - 0.03F}, {0, 0.8F, 0}, {1.6F, 0, 0}, m.laminate);
  for (const float x : {0.05F, 1.51F}) {
    builder.box({x, -0.72F, 0}, {x + 0.05F, -0.67F, height - 0.03F}, m.metal);
    builder.box({x, -0.10F, 0}, {x + 0.05F, -0.05F, height - 0.03F}, m.metal);
    builder.box({x, -0.75F, 0}, {x + 0.05F, -0.03F, 0.03F}, m.metal);
  }
  builder.box({0.1F, -0.06F, 0.25F}, {1.5F, -0.04F, height - 0.03F}, m.laminate);
  if (random.chance(0.7F)) {
    add_cabinet(builder.at({random.chance(0.5F) ? 0.12F : 1.05F, -0.12F, 0}), {0.42F, 0.55F, 0.58F},
                m.laminate, m);
  }
  if (random.chance(0.6F)) {
    const float x = random.uniform(0.55F, 0.8F);
    builder.box({x, -0.6F, 0.02F}, {x + 0.18F, -0.18F, 0.44F}, m.dark_plastic);
  }
  const int screen = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_screen(random.fork("screen")), 0.56F, Repeat::kClamp),
       .reflectivity = 0.03F,
       .emission_nit = random.chance(0.6F) ? 90.0F : 0.0F,
       .ir_reflectance = 0.05F});
  Builder monitor =
      builder.at({random.uniform(0.5F, 1.1F), -0.25F, height}, random.uniform(-0.25F, 0.25F));
  monitor.box({-0.28F, 0, 0.1F}, {0.28F, 0.04F, 0.44F}, m.dark_plastic, screen);
  monitor.box({-0.03F, 0.01F, 0.01F}, {0.03F, 0.03F, 0.1F}, m.dark_plastic);
  monitor.box({-0.12F, -0.05F, 0}, {0.12F, 0.1F, 0.012F}, m.dark_plastic);
  builder.box({0.55F, -0.62F, height}, {0.99F, -0.48F, height + 0.02F}, m.dark_plastic);
  add_clutter(builder, {0, -0.8F, height}, {1.6F, 0.8F}, 4 + random.index(5),
              random.fork("clutter"));
}

void add_office_chair(Builder builder, const FurnitureMaterials& m, Random random) {
  constexpr int kFeet = 5;
  builder = builder.at(Vector3f::Zero(), random.uniform(-0.7F, 0.7F));
  for (int i = 0; i < kFeet; ++i) {
    const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / kFeet;
    const Vector3f tip{0.27F * std::cos(angle), 0.27F * std::sin(angle), 0.07F};
    builder.rod({0, 0, 0.1F}, tip, 0.022F, m.dark_plastic);
    builder.rod(tip - Vector3f{0, 0, 0.04F}, tip - Vector3f{0, 0, 0.039F}, 0.03F, m.dark_plastic);
  }
  builder.rod({0, 0, 0.1F}, {0, 0, 0.42F}, 0.028F, m.metal);
  builder.box({-0.23F, -0.23F, 0.43F}, {0.23F, 0.23F, 0.5F}, m.fabric);
  builder.quad({-0.23F, -0.23F, 0.43F}, {0, 0.46F, 0}, {0.46F, 0, 0}, m.dark_plastic);
  builder.box({-0.21F, -0.26F, 0.58F}, {0.21F, -0.2F, 1.05F}, m.fabric);
  builder.rod({0, -0.2F, 0.45F}, {0, -0.24F, 0.7F}, 0.025F, m.dark_plastic);
}

void add_chair(Builder builder, const FurnitureMaterials& m) {
  for (const float x : {-0.19F, 0.19F}) {
    builder.rod({x, -0.19F, 0.02F}, {x, -0.18F, 0.44F}, 0.018F, m.wood);
    builder.rod({x, 0.19F, 0.02F}, {x, 0.19F, 0.9F}, 0.018F, m.wood);
  }
  builder.box({-0.21F, -0.21F, 0.44F}, {0.21F, 0.21F, 0.47F}, m.wood);
  builder.quad({-0.21F, -0.21F, 0.44F}, {0, 0.42F, 0}, {0.42F, 0, 0}, m.wood);
  builder.box({-0.19F, 0.18F, 0.65F}, {0.19F, 0.2F, 0.9F}, m.wood);
}

void add_table(Builder builder, const Vector3f& size_m, const FurnitureMaterials& m) {
  const float x = 0.5F * size_m.x();
  const float y = 0.5F * size_m.y();
  builder.box({-x, -y, size_m.z() - 0.035F}, {x, y, size_m.z()}, m.wood);
  builder.quad({-x, -y, size_m.z() - 0.035F}, {0, 2 * y, 0}, {2 * x, 0, 0}, m.wood);
  for (const Vector2f& leg : {Vector2f{-x, -y}, Vector2f{x - 0.06F, -y}, Vector2f{-x, y - 0.06F},
                              Vector2f{x - 0.06F, y - 0.06F}}) {
    builder.box({leg.x(), leg.y(), 0}, {leg.x() + 0.06F, leg.y() + 0.06F, size_m.z() - 0.035F},
                m.wood);
  }
}

void add_bookshelf(Builder builder, float width_m, const FurnitureMaterials& m) {
  builder.box({0, -0.35F, 0}, {width_m, 0, 1.9F}, m.wood, m.books);
}

void add_cabinet(Builder builder, const Vector3f& size_m, int material,
                 const FurnitureMaterials& m) {
  builder.box({0, -size_m.y(), 0}, {size_m.x(), 0, size_m.z()}, material);
  const int drawers = std::max(2, static_cast<int>(size_m.z() / 0.28F));
  for (int i = 0; i < drawers; ++i) {
    const float bottom = size_m.z() * (static_cast<float>(i) + 0.06F) / static_cast<float>(drawers);
    const float top = size_m.z() * (static_cast<float>(i) + 0.94F) / static_cast<float>(drawers);
    builder.box({0.02F, -size_m.y() - 0.015F, bottom}, {size_m.x() - 0.02F, -size_m.y(), top},
                material);
    builder.box({0.4F * size_m.x(), -size_m.y() - 0.04F, top - 0.06F},
                {0.6F * size_m.x(), -size_m.y() - 0.015F, top - 0.045F}, m.metal);
  }
}

void add_plant(Builder builder, float height_m, const FurnitureMaterials& m, Random random) {
  constexpr int kLeaves = 40;
  builder.box({-0.16F, -0.16F, 0}, {0.16F, 0.16F, 0.3F}, m.white);
  builder.rod({0, 0, 0.3F}, {0, 0, 0.7F * height_m}, 0.015F, m.wood);
  for (int i = 0; i < kLeaves; ++i) {
    const float turn = random.uniform(0.0F, 2.0F * std::numbers::pi_v<float>);
    Builder leaf = builder.at({0, 0, random.uniform(0.4F, 0.75F) * height_m}, turn);
    const float rise = random.uniform(-0.1F, 0.25F);
    const float reach = random.uniform(0.15F, 0.3F);
    const float bend = rise * (0.5F * reach - 0.03F) / (reach - 0.03F);
    leaf.facet({Vector3f{0.03F, 0, 0}, Vector3f{0.5F * reach, -0.04F, bend},
                Vector3f{reach, 0, rise}, Vector3f{0.5F * reach, 0.04F, bend}},
               m.foliage);
  }
}

void add_sofa(Builder builder, float width_m, const FurnitureMaterials& m) {
  builder.box({0, -0.9F, 0.08F}, {width_m, 0, 0.42F}, m.fabric);
  builder.box({0, -0.25F, 0.42F}, {width_m, 0, 0.85F}, m.fabric);
  builder.box({0, -0.9F, 0.42F}, {0.18F, -0.25F, 0.62F}, m.fabric);
  builder.box({width_m - 0.18F, -0.9F, 0.42F}, {width_m, -0.25F, 0.62F}, m.fabric);
  builder.box({0.25F, -0.45F, 0.42F}, {0.7F, -0.26F, 0.8F}, m.cushion);
  builder.box({width_m - 0.75F, -0.45F, 0.42F}, {width_m - 0.3F, -0.26F, 0.8F}, m.cushion);
  for (const float x : {0.08F, width_m - 0.08F}) {
    builder.rod({x, -0.82F, 0.025F}, {x, -0.82F, 0.08F}, 0.025F, m.wood);
    builder.rod({x, -0.1F, 0.025F}, {x, -0.1F, 0.08F}, 0.025F, m.wood);
  }
}

void add_door(Builder builder, const FurnitureMaterials& m) {
  builder.box({0, -0.03F, 0}, {0.07F, 0, 2.05F}, m.frame);
  builder.box({0.88F, -0.03F, 0}, {0.95F, 0, 2.05F}, m.frame);
  builder.box({0.07F, -0.03F, 1.98F}, {0.88F, 0, 2.05F}, m.frame);
  builder.box({0.07F, -0.012F, 0.005F}, {0.88F, 0, 1.98F}, m.door);
  builder.rod({0.8F, -0.05F, 1.02F}, {0.68F, -0.05F, 1.02F}, 0.011F, m.metal);
  builder.rod({0.8F, -0.05F, 1.02F}, {0.8F, 0, 1.02F}, 0.011F, m.metal);
}

void add_poster(Builder builder, const Vector3f& corner, float size_m, Random random) {
  const int picture =
      builder.material({.albedo = grey(1),
                        .texture = builder.texture(paint_poster(random), size_m, Repeat::kClamp),
                        .reflectivity = 0.01F});
  builder.box(corner - Vector3f{0, 0.004F, 0}, corner + Vector3f{size_m, 0, size_m}, picture);
}

void add_window(Builder builder, float width_m, float luminance_nit, const FurnitureMaterials& m) {
  constexpr float kBottom_m = 0.9F;
  constexpr float kTop_m = 2.2F;
  const float pane = width_m / 2.0F;
  for (int i = 0; i < 2; ++i) {
    const float x = static_cast<float>(i) * pane;
    builder.lamp({x + 0.06F, -0.005F, kBottom_m + 0.06F}, {pane - 0.12F, 0, 0},
                 {0, 0, kTop_m - kBottom_m - 0.12F}, luminance_nit, Rgb{0.92F, 0.97F, 1.0F, 0});
    builder.box({x, -0.04F, kBottom_m}, {x + 0.06F, 0, kTop_m}, m.white);
    builder.box({x + pane - 0.06F, -0.04F, kBottom_m}, {x + pane, 0, kTop_m}, m.white);
    builder.box({x, -0.04F, kTop_m - 0.06F}, {x + pane, 0, kTop_m}, m.white);
  }
  builder.box({-0.05F, -0.14F, kBottom_m - 0.04F}, {width_m + 0.05F, 0, kBottom_m + 0.06F},
              m.white);
}

void add_skirting(Builder builder, float length_m, int material) {
  builder.box({0, -0.01F, 0}, {length_m, 0, 0.08F}, material);  // thinner than a door
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
