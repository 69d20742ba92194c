#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/ray_scene.hpp"

namespace geoflow::simulator {

/// Irradiance on six sides of a point, along +x, -x, +y, -y, +z, -z [lux].
struct LightCube {
  std::array<Rgb, 6> sides{};
  /// On a surface with that unit normal (Mitchell, McTaggart, Green, "Shading in Valve's Source
  /// engine", 2006).
  [[nodiscard]] Rgb at(const Eigen::Vector3f& normal) const noexcept;
};

/// The light of a scene in which nothing moves: direct light of lamps and sun with shadows, and
/// light from surfaces that they shine on. Baked once; read by all threads.
class Lighting {
 public:
  Lighting(const Scene& scene, const RayScene& rays);

  /// Irradiance [lux] on a patch at (u, v) [m], bilinear between texels of some centimetres.
  [[nodiscard]] Rgb on_patch(std::size_t patch, float u, float v) const noexcept;
  /// The same at many points of one patch.
  void on_patch(std::size_t patch, const Lanes& u, const Lanes& v, LaneColours& out) const noexcept;
  /// Around a static capsule's ends.
  [[nodiscard]] const std::array<LightCube, 2>& around_capsule(std::size_t capsule) const noexcept {
    return capsules_[capsule];
  }
  /// Around a point in the air; traces rays.
  [[nodiscard]] LightCube around(const Eigen::Vector3f& point, float clear_radius_m) const;
  /// Luminance of the sky in a direction [cd/m^2]; 0 indoors.
  [[nodiscard]] Rgb sky(const Eigen::Vector3f& direction) const noexcept;

 private:
  struct Map {
    int columns = 0;
    int rows = 0;
    std::size_t first = 0;  ///< in texels_
    float columns_per_m = 1;
    float rows_per_m = 1;
  };
  [[nodiscard]] Rgb direct(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const;
  [[nodiscard]] Rgb indirect(const Eigen::Vector3f& point, const Eigen::Vector3f& normal,
                             float clear_radius_m) const;
  [[nodiscard]] Rgb reflected(const RayPacket& packet, std::size_t lane) const;
  void lay_out_maps();
  void bake_direct();
  void bake_indirect();

  const Scene* scene_;
  const RayScene* rays_;
  std::vector<Map> maps_;
  std::vector<Rgb> texels_;
  std::vector<Rgb> mean_albedo_;  ///< of each material
  float further_bounces_ = 1;     ///< times light of one bounce: light of all
  std::vector<std::array<LightCube, 2>> capsules_;
};

}  // namespace geoflow::simulator
