#pragma once

#include "src/builder.hpp"

namespace geoflow::simulator {

/// A box of a room seen from inside, its corner at the builder's origin.
struct Room {
  Vector3f size_m{10, 8, 2.8F};  // NOLINT(readability-magic-numbers): a common room
  int floor = 0;
  int wall = 0;
  int ceiling = 0;
};
/// Floor, four walls and ceiling; the surfaces look inwards.
void add_room(Builder builder, const Room& room);

/// The side of a room: its builder's -y looks into the room, x runs from the left to the right
/// corner as seen from inside.
enum class Side { kSouth, kEast, kNorth, kWest };
[[nodiscard]] Builder wall_of(const Builder& builder, const Room& room, Side side);
[[nodiscard]] float wall_length(const Room& room, Side side);

/// Rows of lamps under the ceiling that together give about `lux` on the floor.
struct CeilingLamps {
  float lux = 400;              // NOLINT(readability-magic-numbers): EN 12464-1, offices 300 … 500
  Vector2f spacing_m{3, 3};     // NOLINT(readability-magic-numbers)
  Vector2f size_m{1.2F, 0.3F};  // NOLINT(readability-magic-numbers)
  Rgb colour{1.0F, 0.97F, 0.92F, 0};  // NOLINT(readability-magic-numbers): 4000 K
};
void add_ceiling_lamps(Builder builder, const Vector3f& room_size_m, const CeilingLamps& lamps);

}  // namespace geoflow::simulator
