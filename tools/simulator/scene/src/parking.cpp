#include <array>
#include <numbers>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/layouts.hpp"
#include "src/painters.hpp"
#include "src/room.hpp"

// A layout is its measures in metres. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

constexpr float kSlot_m = 2.5F;
constexpr float kSlotDepth_m = 5.0F;
constexpr float kLane_m = 6.0F;
constexpr float kMarking_m = 0.1F;
constexpr float kMarkingHeight_m = 0.001F;
constexpr int kSlotsBetweenPillars = 3;
constexpr float kLamp_nit = 6000;  // a fluorescent tube

struct Materials {
  int glass = 0;
  int tyre = 0;
  int rim = 0;
  int light = 0;
  int plate = 0;
  int marking = 0;
  int concrete = 0;
  int stripe = 0;
};

/// A car of 4.3 x 1.75 m about the origin, its nose towards +x.
void add_car(Builder builder, const Materials& m, Random random) {
  const float tone = random.uniform(0.02F, 0.7F);
  const Rgb colour{tone * random.uniform(0.7F, 1.0F), tone * random.uniform(0.7F, 1.0F),
                   tone * random.uniform(0.7F, 1.0F), 0};
  const int paint = builder.material({.albedo = colour, .reflectivity = 0.06F, .roughness = 0.01F});
  const float half = 0.5F * random.uniform(1.7F, 1.85F);
  const float roof = random.uniform(1.42F, 1.65F);
  const std::array<Vector2f, 6> body{Vector2f{-2.1F, 0.22F}, {2.1F, 0.22F},  {2.15F, 0.6F},
                                     {1.95F, 0.8F},          {-2.0F, 0.92F}, {-2.15F, 0.6F}};
  builder.prism(body, -half, half, paint);
  const std::array<Vector2f, 4> cabin{
      Vector2f{-1.9F, 0.9F}, {1.1F, 0.8F}, {0.35F, roof}, {-1.5F, roof}};
  builder.prism(cabin, -half + 0.1F, half - 0.1F, m.glass);
  builder.box({-1.5F, -half + 0.09F, roof - 0.03F}, {0.37F, half - 0.09F, roof + 0.01F}, paint);
  for (const float y : {-half + 0.09F, half - 0.13F}) {
    builder.box({-0.45F, y, 0.85F}, {-0.33F, y + 0.04F, roof}, paint);
  }
  for (const float x : {-1.3F, 1.3F}) {
    for (const float side : {-1.0F, 1.0F}) {
      builder.wheel({x, side * (half - 0.08F), 0.31F}, 0.31F, 0.2F, m.tyre);
      builder.wheel({x, side * (half + 0.025F), 0.31F}, 0.19F, 0.02F, m.rim);
    }
  }
  for (const float y : {-half + 0.1F, half - 0.45F}) {
    builder.box({2.05F, y, 0.58F}, {2.17F, y + 0.35F, 0.72F}, m.light);
    builder.box({-2.17F, y, 0.6F}, {-2.05F, y + 0.35F, 0.78F}, m.rim);
  }
  builder.box({2.1F, -0.26F, 0.36F}, {2.18F, 0.26F, 0.47F}, m.plate);
  builder.box({-2.18F, -0.26F, 0.45F}, {-2.1F, 0.26F, 0.56F}, m.plate);
}

/// Slots along x from the origin, open towards -y, with cars and with pillars between them at the
/// far end.
void add_row(Builder builder, int slots, float ceiling_m, const Materials& m, Random random) {
  for (int i = 0; i <= slots; ++i) {
    const float x = kSlot_m * static_cast<float>(i);
    builder.quad({x - 0.5F * kMarking_m, -kSlotDepth_m, kMarkingHeight_m}, {kMarking_m, 0, 0},
                 {0, kSlotDepth_m, 0}, m.marking);
    if (i % kSlotsBetweenPillars == 0) {
      builder.box({x - 0.25F, -kSlotDepth_m + 0.2F, 0},
                  {x + 0.25F, -kSlotDepth_m + 0.8F, ceiling_m}, m.concrete);
      builder.box({x - 0.255F, -kSlotDepth_m + 0.195F, 0.7F},
                  {x + 0.255F, -kSlotDepth_m + 0.805F, 0.95F}, m.stripe);
    }
  }
  for (int i = 0; i < slots; ++i) {
    if (random.chance(0.72F)) {
      const float turn = random.chance(0.5F) ? 0.5F : -0.5F;
      add_car(builder.at({kSlot_m * (static_cast<float>(i) + 0.5F) + random.uniform(-0.1F, 0.1F),
                          -0.5F * kSlotDepth_m + random.uniform(0.05F, 0.25F), 0},
                         (turn + random.uniform(-0.012F, 0.012F)) * std::numbers::pi_v<float>),
              m, Random{random.bits()});
    }
  }
}

Materials make_materials(Builder& builder, Random random) {
  Materials m;
  m.glass =
      builder.material({.albedo = grey(0.02F), .reflectivity = 0.09F, .ir_reflectance = 0.02F});
  m.tyre = builder.material({.albedo = grey(0.03F), .ir_reflectance = 0.05F});
  m.rim = builder.material({.albedo = grey(0.3F), .reflectivity = 0.2F, .roughness = 0.05F});
  m.light = builder.material({.albedo = grey(0.55F), .reflectivity = 0.1F});
  m.plate = builder.material(
      {.albedo = grey(1), .texture = builder.texture(paint_poster(random.fork("plate")), 0.5F)});
  m.marking = builder.paint(grey(0.6F));
  m.concrete = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_concrete(0.42F, random.fork("pillar")), 1.7F)});
  m.stripe = builder.paint(Rgb{0.65F, 0.5F, 0.05F, 0});
  return m;
}

/// The place of the i-th of things that stand `step` apart.
float along(int i, float first, float step) {
  return first + static_cast<float>(i) * step;
}

/// Tubes along both lanes, of which some are out, and one in the middle.
void hang_lamps(Builder builder, const Vector3f& hall_m, float lane_y, Random& random) {
  const auto hang = [&](float x, float y) {
    builder.lamp({x, y - 0.06F, hall_m.z() - 0.37F}, {0, 0.12F, 0}, {1.2F, 0, 0}, kLamp_nit,
                 Rgb{0.95F, 1.0F, 0.88F, 0});
  };
  for (const float y : {lane_y, hall_m.y() - lane_y}) {
    for (int i = 0; along(i, 3.0F, 6.0F) < hall_m.x(); ++i) {
      if (random.chance(0.75F)) {
        hang(along(i, 3.0F, 6.0F), y);
      }
    }
  }
  hang(0.5F * hall_m.x(), 0.5F * hall_m.y());
}

}  // namespace

void lay_out_parking(Builder builder, Random random) {
  const Materials m = make_materials(builder, random.fork("materials"));
  const int middle_slots = 3 * (2 + random.index(2));
  const float middle_m = kSlot_m * static_cast<float>(middle_slots);
  const int slots = middle_slots + 5;
  const float length = middle_m + 2.0F * kLane_m;
  const float depth = 4.0F * kSlotDepth_m + 2.0F * kLane_m;
  const float height = random.uniform(2.6F, 3.0F);
  // A sealed floor: it mirrors at grazing angles.
  const int floor = builder.material(
      {.albedo = grey(1),
       .texture =
           builder.texture(paint_concrete(random.uniform(0.2F, 0.28F), random.fork("floor")), 2.6F),
       .overlay = builder.texture(paint_stains(0.16F, random.fork("stains")), 6.3F),
       .reflectivity = 0.05F,
       .roughness = 0.006F});
  const Room hall{
      .size_m = {length, depth, height}, .floor = floor, .wall = m.concrete, .ceiling = m.concrete};
  add_room(builder, hall);
  for (int i = 0; along(i, 4.0F, 7.5F) < length; ++i) {
    const float x = along(i, 4.0F, 7.5F);
    builder.box({x, 0, height - 0.35F}, {x + 0.4F, depth, height}, m.concrete);
    builder.quad({x, 0, height - 0.35F}, {0, depth, 0}, {0.4F, 0, 0}, m.concrete);
  }
  constexpr float kFirstPipe_m = 0.5F * kSlotDepth_m + 3.2F;
  for (int i = 0; along(i, kFirstPipe_m, 7.0F) < depth; ++i) {
    const float y = along(i, kFirstPipe_m, 7.0F);
    builder.rod({0.5F, y, height - 0.12F}, {length - 0.5F, y, height - 0.12F}, 0.06F, m.rim);
  }
  const float lane_y = kSlotDepth_m + 0.5F * kLane_m;
  hang_lamps(builder, hall.size_m, lane_y, random);

  constexpr float kHalfTurn = std::numbers::pi_v<float>;
  const float row_m = kSlot_m * static_cast<float>(slots);
  const float row_x = 0.5F * (length - row_m);
  add_row(builder.at({row_x, depth, 0}), slots, height, m, random.fork("north"));
  add_row(builder.at({row_x + row_m, 0, 0}, kHalfTurn), slots, height, m, random.fork("south"));
  add_row(builder.at({kLane_m + middle_m, 0.5F * depth, 0}, kHalfTurn), middle_slots, height, m,
          random.fork("middle north"));
  add_row(builder.at({kLane_m, 0.5F * depth, 0}), middle_slots, height, m,
          random.fork("middle south"));

  const auto low_x = static_cast<double>(0.5F * kLane_m);
  const double high_x = static_cast<double>(length) - low_x;
  const auto low_y = static_cast<double>(lane_y);
  const auto high_y = static_cast<double>(depth - lane_y);
  builder.scene().waypoints = {
      {low_x, low_y}, {high_x, low_y}, {high_x, high_y}, {low_x, high_y}, {low_x, low_y}};
  builder.scene().closed = true;
  const float beside = lane_y + 1.2F;
  add_pedestrians(builder,
                  {{{2.0F, beside}, {length - 2.0F, beside}},
                   {{2.0F, depth - beside}, {length - 2.0F, depth - beside}}},
                  0, random.fork("people"));
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
