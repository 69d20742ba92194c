#include <numbers>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/layouts.hpp"
#include "src/painters.hpp"
#include "src/room.hpp"

// A layout is its measures in metres. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

constexpr float kShortestHall_m =
    24;                        // longer than depth reaches, so that a flat wall's ends do not help
constexpr float kStage_m = 9;  // of the middle of the hall is walked along
constexpr float kPanelHeight_m = 1.8F;
constexpr float kPi = std::numbers::pi_v<float>;

/// A row of standing panels from the origin along x, that zigzags towards -y.
void add_zigzag(Builder builder, float length_m, int material, Random random) {
  Vector3f from{0, 0, 0};
  bool out = true;
  while (from.x() < length_m) {
    const float depth = out ? -random.uniform(0.3F, 0.6F) : 0.0F;
    const Vector3f to{from.x() + random.uniform(0.45F, 0.8F), depth, 0};
    Patch& panel = builder.quad(from, to - from, {0, 0, kPanelHeight_m}, material);
    panel.texture_offset_m = {random.uniform(0.0F, 3.0F), random.uniform(0.0F, 3.0F)};
    // Its back, a centimetre behind.
    const Vector3f behind = 0.01F * (to - from).normalized().cross(Vector3f::UnitZ());
    builder.quad(to - behind, from - to, {0, 0, kPanelHeight_m}, material);
    from = to;
    out = !out;
  }
}

/// What stands along a side of the lane, which lies towards -y: panels, a picture on the wall, or
/// nothing.
void add_side(Builder builder, float hall_m, const StructureCase& which, int material,
              Random random) {
  if (which.structure) {
    const float length_m = kStage_m + 8.0F;
    add_zigzag(builder.at({0.5F * (hall_m - length_m), -0.05F, 0}), length_m, material, random);
  } else if (which.texture) {
    builder.quad({0, -0.01F, 0}, {hall_m, 0, 0}, {0, 0, kPanelHeight_m + 0.5F}, material);
  }
}

}  // namespace

void lay_out_structure(Builder builder, const StructureCase& which, Random random) {
  const int wall = builder.material(
      {.albedo = grey(1),
       .texture = builder.texture(paint_plaster(grey(0.74F), random.fork("wall")), 2.0F)});
  const int plain = builder.material(
      {.albedo = grey(1),
       .texture =
           builder.texture(paint_plaster(Rgb{0.55F, 0.53F, 0.5F, 0}, random.fork("plain")), 2.0F)});
  const Rgb ground{0.5F, 0.45F, 0.4F, 0};
  const int coloured = builder.material(
      {.albedo = grey(1),
       .texture =
           builder.texture(paint_pattern(ground, random.fork("pattern")), 1.1F, Repeat::kShuffle),
       .overlay = builder.texture(paint_stains(0.25F, random.fork("stains")), 4.3F)});
  const float distance = which.near ? random.uniform(0.9F, 1.1F) : random.uniform(2.0F, 2.4F);
  const float hall_m = random.uniform(kShortestHall_m, kShortestHall_m + 4.0F);
  // A lane between two like sides: one is before the camera wherever the path, which winds from one
  // to the other, leads.
  const float sway = which.near ? 0.45F : 0.8F;
  const float reach = which.structure ? 0.65F : 0.05F;
  const float middle = reach + distance + sway;
  const Room hall{.size_m = {hall_m, 2.0F * middle, 4.0F},
                  .floor = which.texture ? coloured : plain,
                  .wall = wall,
                  .ceiling = builder.paint(grey(0.7F))};
  add_room(builder, hall);
  add_ceiling_lamps(builder, hall.size_m, {.lux = 350, .spacing_m = {4, 4}});
  const float begin = 0.5F * (hall_m - kStage_m);
  const float end = begin + kStage_m;
  for (const bool left : {true, false}) {
    const Builder side = left ? builder.at({0, 2.0F * middle, 0}) : builder.at({hall_m, 0, 0}, kPi);
    add_side(side, hall_m, which, which.texture ? coloured : plain,
             random.fork(left ? "panels" : "other panels"));
  }
  const int legs = which.near ? 8 : 6;
  for (int leg = 0; leg <= legs; ++leg) {
    const float x = begin + kStage_m * static_cast<float>(leg) / static_cast<float>(legs);
    const float y = middle + (leg % 2 == 0 ? -sway : sway);
    builder.scene().waypoints.emplace_back(static_cast<double>(x), static_cast<double>(y));
  }
  add_pedestrians(builder, {{{begin, middle}, {end, middle}}}, 0, random.fork("people"));
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
