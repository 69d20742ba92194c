#pragma once

#include <vector>

#include "geoflow/tools/simulator/random.hpp"

#include "src/builder.hpp"

/// One function a kind of place: fills the scene and sets its path. Sizes, places and looks come
/// from `random`.
namespace geoflow::simulator {

void lay_out_office(Builder builder, Random random);
void lay_out_corridor(Builder builder, Random random);
void lay_out_parking(Builder builder, Random random);
void lay_out_plaza(Builder builder, Random random);
void lay_out_home(Builder builder, Random random);

/// The cases of the TUM RGB-D benchmark's sequences structure x texture x distance.
struct StructureCase {
  bool structure = true;
  bool texture = true;
  bool near = false;
};
void lay_out_structure(Builder builder, const StructureCase& which, Random random);

/// Adds walkers along the lines in turn: as many as the options say, or `fallback`.
void add_pedestrians(Builder builder, const std::vector<std::vector<Vector2f>>& lines, int fallback,
                     Random random);

}  // namespace geoflow::simulator
