#include <cmath>
#include <numbers>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/layouts.hpp"
#include "src/painters.hpp"

// A layout is its measures in metres. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

constexpr float kPlaza_m = 90;
constexpr float kFree_m = 6;  // around the walked line

struct Materials {
  int bark = 0;
  int foliage = 0;
  int bench = 0;
  int metal = 0;
  int stone = 0;
};

void add_tree(Builder builder, const Materials& m, Random random) {
  constexpr int kLeaves = 170;
  constexpr float kTwoPi = 2.0F * std::numbers::pi_v<float>;
  const float trunk = random.uniform(2.2F, 3.0F);
  const float crown = random.uniform(1.4F, 2.1F);
  builder.rod({0, 0, -0.1F}, {random.uniform(-0.1F, 0.1F), 0, trunk + 0.6F * crown},
              random.uniform(0.1F, 0.16F), m.bark);
  builder.box({-0.7F, -0.7F, 0}, {0.7F, 0.7F, 0.12F}, m.stone);
  for (int i = 0; i < kLeaves; ++i) {
    const float up = random.uniform(-1.0F, 1.0F);
    const float turn = random.uniform(0.0F, kTwoPi);
    const float reach = crown * std::cbrt(random.uniform(0.3F, 1.0F));
    const float flat = std::sqrt(1.0F - up * up);
    Builder leaf = builder.at({reach * flat * std::cos(turn), reach * flat * std::sin(turn),
                               trunk + 0.7F * crown + 0.85F * reach * up},
                              random.uniform(0.0F, kTwoPi));
    const float size = random.uniform(0.3F, 0.55F);
    const float tilt = random.uniform(-0.7F, 0.7F) * size;
    leaf.quad({-size, 0, -tilt}, {2.0F * size, 0, 2.0F * tilt},
              {0, size, random.uniform(-0.3F, 0.3F)}, m.foliage);
  }
}

void add_bench(Builder builder, const Materials& m) {
  for (int slat = 0; slat < 4; ++slat) {
    const float y = -0.22F + 0.12F * static_cast<float>(slat);
    builder.box({-0.9F, y, 0.42F}, {0.9F, y + 0.09F, 0.45F}, m.bench);
  }
  for (const float x : {-0.7F, 0.65F}) {
    builder.box({x, -0.22F, 0}, {x + 0.05F, 0.22F, 0.42F}, m.metal);
  }
}

void add_lamp_post(Builder builder, const Materials& m) {
  builder.rod({0, 0, -0.1F}, {0, 0, 4.2F}, 0.06F, m.metal);
  builder.rod({0, 0, 4.3F}, {0, 0, 4.45F}, 0.2F, m.stone);
}

/// Something at a random place between the walked line's surroundings and the buildings.
Vector3f place_aside(Random& random, const Vector2f& half_walk) {
  for (;;) {
    const Vector3f at{random.uniform(-26.0F, 26.0F), random.uniform(-26.0F, 26.0F), 0};
    const bool outside =
        std::abs(at.x()) > half_walk.x() + kFree_m || std::abs(at.y()) > half_walk.y() + kFree_m;
    if (outside) {
      return at;
    }
  }
}

/// A clear day, some hours from noon.
Daylight daylight(float light, Random& random) {
  const float azimuth = random.uniform(0.0F, 2.0F * std::numbers::pi_v<float>);
  const float elevation = random.uniform(0.6F, 0.95F);
  return {.to_sun = {std::cos(elevation) * std::cos(azimuth),
                     std::cos(elevation) * std::sin(azimuth), std::sin(elevation)},
          .sun_lux = 55'000.0F * light,
          .sun_colour = Rgb{1.0F, 0.96F, 0.88F, 0},
          .sky_nit = 4'000.0F * light,
          .sky_colour = Rgb{0.45F, 0.65F, 1.0F, 0}};
}

}  // namespace

void lay_out_plaza(Builder builder, Random random) {
  Scene& scene = builder.scene();
  scene.daylight = daylight(static_cast<float>(builder.options().light_level), random);
  const float warm = random.uniform(0.85F, 1.0F);
  const TileStyle slabs{.colour = Rgb{0.36F, 0.35F * warm, 0.33F * warm, 0},
                        .joint = grey(0.12F),
                        .count = 2,
                        .joint_fraction = 0.016F};
  const int ground = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_tiles(slabs, random.fork("slabs")), 1.2F)});
  const Materials m{.bark = builder.paint(Rgb{0.14F, 0.1F, 0.07F, 0}),
                    .foliage = builder.material(
                        {.albedo = grey(1),
                         .texture = builder.texture(paint_foliage(random.fork("leaves")), 1.0F),
                         .ir_reflectance = 0.45F}),
                    .bench = builder.paint(Rgb{0.3F, 0.18F, 0.09F, 0}),
                    .metal = builder.paint(grey(0.1F)),
                    .stone = builder.paint(grey(0.4F))};
  const float half = 0.5F * kPlaza_m;
  builder.quad({-half, -half, 0}, {kPlaza_m, 0, 0}, {0, kPlaza_m, 0}, ground);

  constexpr float kQuarter = 0.5F * std::numbers::pi_v<float>;
  for (int side = 0; side < 4; ++side) {
    Builder edge = builder.at(Vector3f::Zero(), kQuarter * static_cast<float>(side));
    if (side == 3 && random.chance(0.5F)) {
      continue;  // open to one side
    }
    for (float x = -half; x < half - 6.0F;) {
      const float width = random.uniform(10.0F, 18.0F);
      const float tone = random.uniform(0.3F, 0.6F);
      const Rgb wall{tone, tone * random.uniform(0.78F, 0.95F), tone * random.uniform(0.55F, 0.85F),
                     0};
      const int facade = builder.material(
          {.albedo = grey(1),
           .texture = builder.texture(paint_facade(wall, Random{random.bits()}), 6.5F)});
      edge.box({x, random.uniform(30.0F, 36.0F), 0}, {x + width, half, random.uniform(8.0F, 16.0F)},
               facade);
      x += width + (random.chance(0.3F) ? 3.0F : 0.0F);
    }
  }
  const Vector2f half_walk{random.uniform(6.0F, 8.0F), random.uniform(4.0F, 6.0F)};
  for (int i = 0; i < 9; ++i) {
    add_tree(builder.at(place_aside(random, half_walk)), m, Random{random.bits()});
  }
  for (int i = 0; i < 6; ++i) {
    add_bench(builder.at(place_aside(random, half_walk), random.uniform(0.0F, 6.0F)), m);
    add_lamp_post(builder.at(place_aside(random, half_walk)), m);
  }
  const auto x = static_cast<double>(half_walk.x());
  const auto y = static_cast<double>(half_walk.y());
  scene.waypoints = {{-x, -y}, {x, -y}, {x, y}, {-x, y}, {-x, -y}};
  scene.closed = true;
  add_pedestrians(builder,
                  {{{-20, -half_walk.y() - 3.0F}, {20, -half_walk.y() - 3.0F}},
                   {{half_walk.x() + 3.0F, -20}, {half_walk.x() + 3.0F, 20}}},
                  2, random.fork("people"));
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
