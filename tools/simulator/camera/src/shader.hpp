#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/scene.hpp"

#include "src/lighting.hpp"
#include "src/ray_scene.hpp"

namespace geoflow::simulator {

/// What a camera sees of the place where a ray ends.
struct Surface {
  const Material* material = nullptr;  ///< null: the sky
  Rgb albedo{};                        ///< with texture
  Rgb irradiance{};                    ///< [lux]
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  ///< towards the viewer
  float cosine = 1;                                   ///< of the angle between normal and ray
  float contrast = 0;                                 ///< Texture::contrast(), if looked for
};

/// Light that comes back along rays. Moving the people is for one thread; all else is const and
/// thread-safe.
class Shader {
 public:
  Shader(const Scene& scene, const RayScene& rays, const Lighting& lighting);

  /// Takes the people's places at a time [s] for their shadows and the light on them.
  void move_people(double t_s);

  /// How a packet's rays are to be looked at.
  struct Look {
    float footprint_per_t =
        0;             ///< length on a surface that faces the camera, a unit of the ray's parameter
    float spread = 1;  ///< rays a pixel: how much finer each looks across a slanted surface
    std::uint64_t key = 0;  ///< of the mirrors' roughness
    bool quickly = false;   ///< coarser textures, for mirror images
    bool contrast = false;  ///< Surface::contrast is wanted
  };
  /// Luminance [cd/m^2] seen by each valid lane of a traced packet.
  void shade(const std::array<int, kPacket>& valid, const RayPacket& packet, const Look& look,
             std::array<Rgb, kPacket>& out) const;

  /// The surface that a lane hit.
  [[nodiscard]] Surface surface(const RayPacket& packet, std::size_t lane, const Look& look) const;

  /// The sun's illuminance [lux] on a plane that faces it; 0 indoors.
  [[nodiscard]] float sun_lux() const noexcept {
    return scene_->daylight ? scene_->daylight->sun_lux : 0.0F;
  }

  /// Mirror reflectance at that angle (Schlick, "An inexpensive BRDF model", 1994).
  [[nodiscard]] static float mirror_reflectance(const Surface& surface) noexcept;

 private:
  struct Person {
    Eigen::Vector2f position;
    Eigen::Vector2f shadow;  ///< from the feet to the head's shadow [m]
    LightCube light;
  };
  void look_at_patch(std::size_t index, const Look& look, float t, Surface& surface) const;
  [[nodiscard]] float person_shadow(const Eigen::Vector3f& point) const;
  [[nodiscard]] static Rgb diffuse(const Surface& surface) noexcept;
  void add_mirrors(const std::array<Surface, kPacket>& surfaces, const RayPacket& packet,
                   const Look& look, std::array<Rgb, kPacket>& out) const;

  const Scene* scene_;
  const RayScene* rays_;
  const Lighting* lighting_;
  std::vector<Rgb> overlay_scale_;  ///< 1 / mean of each texture
  std::vector<Person> people_;
};

}  // namespace geoflow::simulator
