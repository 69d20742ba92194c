#include "src/room.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "src/builder.hpp"

namespace geoflow::simulator {

void add_room(Builder builder, const Room& room) {
  const Vector3f x{room.size_m.x(), 0, 0};
  const Vector3f y{0, room.size_m.y(), 0};
  const Vector3f z{0, 0, room.size_m.z()};
  builder.quad(Vector3f::Zero(), x, y, room.floor);
  builder.quad(z, y, x, room.ceiling);
  for (const Side side : {Side::kSouth, Side::kEast, Side::kNorth, Side::kWest}) {
    Builder wall = wall_of(builder, room, side);
    wall.quad(Vector3f::Zero(), {wall_length(room, side), 0, 0}, z, room.wall);
  }
}

Builder wall_of(const Builder& builder, const Room& room, Side side) {
  constexpr float kQuarter = 0.5F * std::numbers::pi_v<float>;
  const Vector3f& size = room.size_m;
  switch (side) {
    case Side::kSouth:
      return builder.at({size.x(), 0, 0}, 2.0F * kQuarter);
    case Side::kEast:
      return builder.at({size.x(), size.y(), 0}, -kQuarter);
    case Side::kNorth:
      return builder.at({0, size.y(), 0});
    case Side::kWest:
      return builder.at(Vector3f::Zero(), kQuarter);
  }
  return builder;
}

float wall_length(const Room& room, Side side) {
  return side == Side::kSouth || side == Side::kNorth ? room.size_m.x() : room.size_m.y();
}

void add_ceiling_lamps(Builder builder, const Vector3f& room_size_m, const CeilingLamps& lamps) {
  // A lamp of luminance L and area a that lights a * n of a floor gives E = pi L a n / A, of which
  // walls lose about half.
  constexpr float kUtilisation = 0.5F;
  constexpr float kBelow_m = 0.02F;
  const int columns =
      std::max(1, static_cast<int>(std::lround(room_size_m.x() / lamps.spacing_m.x())));
  const int rows =
      std::max(1, static_cast<int>(std::lround(room_size_m.y() / lamps.spacing_m.y())));
  const float area = lamps.size_m.x() * lamps.size_m.y() * static_cast<float>(columns * rows);
  const float luminance_nit = lamps.lux * room_size_m.x() * room_size_m.y() /
                              (kUtilisation * std::numbers::pi_v<float> * area);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const float x =
          room_size_m.x() * (static_cast<float>(column) + 0.5F) / static_cast<float>(columns);
      const float y = room_size_m.y() * (static_cast<float>(row) + 0.5F) / static_cast<float>(rows);
      builder.lamp(
          {x - 0.5F * lamps.size_m.x(), y - 0.5F * lamps.size_m.y(), room_size_m.z() - kBelow_m},
          {0, lamps.size_m.y(), 0}, {lamps.size_m.x(), 0, 0}, luminance_nit, lamps.colour);
    }
  }
}

}  // namespace geoflow::simulator
