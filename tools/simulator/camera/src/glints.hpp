#pragma once

#include <cstddef>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"

namespace geoflow::simulator {

/// An image of what is seen by way of mirrors, row by row.
struct Glints {
  Glints(int columns, int rows)
      : width{columns},
        height{rows},
        light(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows)),
        rough(light.size()) {}

  int width;   ///< [px]
  int height;  ///< [px]
  /// Luminance times weight [cd/m^2], the fourth number the weight: the share of a pixel's light
  /// that its rays were mirrored for.
  std::vector<Rgb> light;
  std::vector<float> rough;  ///< deviation of the mirror's normals [rad] times weight
};

/// Adds mirror images to an image. In a rough mirror each of a pixel's few rays meets a glint that
/// points somewhere else; what it sees counts for its neighbours as well, upwards and downwards
/// over a part of what the roughness itself blurs there (a floor's images are blurred along
/// the columns), aside over one or two. `focal_px` is the vertical focal length.
void add_glints(const Glints& glints, float focal_px, std::vector<Rgb>& image);

}  // namespace geoflow::simulator
