#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <embree3/rtcore.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/lighting.hpp"
#include "src/ray_scene.hpp"

namespace geoflow::simulator {

/// What a camera sees of the places where a packet's rays end.
struct Surfaces {
  /// Null: the sky, or a lane that does not count; its other members say nothing.
  std::array<const Material*, kPacket> material{};
  LaneColours albedo{};      ///< with texture
  LaneColours irradiance{};  ///< [lux]
  Lanes normal_x{};          ///< unit, towards the viewer
  Lanes normal_y{};
  Lanes normal_z{};
  Lanes cosine{};    ///< of the angle between normal and ray
  Lanes contrast{};  ///< Texture::contrast(), if looked for
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
    /// Length on a surface that faces the camera, a unit of the ray's parameter.
    float footprint_per_t = 0;
    /// Of which each sees a finer part, also across a slanted surface.
    int rays_a_pixel = 1;
    float dither = 0.5F;    ///< of Texture::sample()
    std::uint64_t key = 0;  ///< of the mirrors' roughness
    bool contrast = false;  ///< Surfaces::contrast is wanted
    /// The ray's number among its pixel's in some order that differs between pixels. A faint mirror
    /// image is seen by the first ones alone, which count for the others.
    std::array<int, kPacket> order{};
  };
  /// Mirrored rays of some of a tile's packets.
  struct Mirrored {    // NOLINT(cppcoreguidelines-pro-type-member-init)
    RayPacket packet;  ///< set as far as `count`
    std::size_t count = 0;
    std::array<std::size_t, kPacket> lane{};  ///< of the ray that was mirrored
    Lanes weight{};                           ///< of its light
    Lanes brightest_nit{};                    ///< it counts for at most
    Lanes roughness{};                        ///< of the mirror
    bool seen = false;                        ///< any of the tile's
    /// Of those that have been seen: luminance times weight [cd/m^2], the fourth number
    /// the weight itself; and roughness times weight.
    LaneColours light{};
    Lanes rough{};
  };
  /// Adds the luminance [cd/m^2] seen by each valid lane of a traced packet to `sum`, but for
  /// mirror images, which come to be in `mirrored`: what is left of them by see_mirrored().
  void shade(const Valid& valid, const RayPacket& packet, const Look& look, Mirrored& mirrored,
             LaneColours& sum) const;
  void see_mirrored(const Look& look, Mirrored& mirrored) const;

  /// The surfaces that the valid lanes hit.
  [[nodiscard]] Surfaces surfaces(const Valid& valid, const RayPacket& packet,
                                  const Look& look) const;

  /// The sun's illuminance [lux] on a plane that faces it; 0 indoors.
  [[nodiscard]] float sun_lux() const noexcept {
    return scene_->daylight ? scene_->daylight->sun_lux : 0.0F;
  }

  /// Mirror reflectance at that angle (Schlick, "An inexpensive BRDF model", 1994).
  [[nodiscard]] static float mirror_reflectance(const Material& material, float cosine) noexcept;

 private:
  static constexpr unsigned kNoPatch = RTC_INVALID_GEOMETRY_ID;
  struct Person {
    Eigen::Vector2f position;
    Eigen::Vector2f shadow;  ///< from the feet to the head's shadow [m]
    LightCube light;
  };
  /// Where a packet's rays meet the plane of a patch.
  struct Hits {
    Lanes x{};  ///< [m] in world
    Lanes y{};
    Lanes z{};
    Lanes u{};  ///< [m] on the patch
    Lanes v{};
    Lanes footprint{};  ///< [m] that a ray sees
    Lanes cosine{};
    float facing = 1;  ///< times the patch's normal: towards the viewer
  };
  [[nodiscard]] static Hits meet(const Patch& patch, const RayPacket& packet, const Look& look,
                                 std::size_t lane);
  void light_and_paint(std::size_t index, const Hits& hits, const Look& look,
                       LaneColours& irradiance, LaneColours& albedo, Lanes& contrast) const;
  void look_at_patch(std::size_t index, const Valid& lanes, const RayPacket& packet,
                     const Look& look, Surfaces& seen) const;
  void look_at_round(std::size_t lane, const RayPacket& packet, Surfaces& seen) const;
  void paint(const Patch& patch, const Hits& hits, const Look& look, LaneColours& albedo,
             Lanes& contrast) const;
  void dim_by_people(const Hits& hits, LaneColours& irradiance) const;
  [[nodiscard]] Rgb light_of(const Surfaces& seen, const RayPacket& packet, std::size_t lane) const;
  void shade_patch(unsigned index, const Valid& valid, const RayPacket& packet, const Look& look,
                   Mirrored& mirrored, LaneColours& sum) const;
  /// Of where a packet's rays are mirrored.
  struct Gloss {
    Lanes share{};  ///< of the light, that comes from the mirror; 0: none worth tracing
    Lanes roughness{};
    Lanes normal_x{};  ///< unit, towards the viewer
    Lanes normal_y{};
    Lanes normal_z{};
    Lanes received{};  ///< luminance of the light that falls there [lux]
  };
  [[nodiscard]] static Gloss gloss_of(const Valid& valid, const Surfaces& seen);
  [[nodiscard]] static Gloss gloss_of(const Valid& valid, const Material& material,
                                      const Eigen::Vector3f& normal, const Hits& hits,
                                      const LaneColours& irradiance);
  /// Takes the mirrors' shares out of `light`, and leaves their rays in `mirrored`.
  void mirror(const Gloss& gloss, const RayPacket& packet, const Look& look, Mirrored& mirrored,
              LaneColours& light) const;
  /// The patch that all valid lanes hit; kNoPatch: none, or several.
  [[nodiscard]] static unsigned only_patch(const Valid& valid, const RayPacket& packet);
  /// Luminance [cd/m^2] without mirrors of lanes that hit one patch; `irradiance` on it [lux].
  void light_of_patch(unsigned index, const Hits& hits, const Look& look, LaneColours& irradiance,
                      LaneColours& light) const;

  const Scene* scene_;
  const RayScene* rays_;
  const Lighting* lighting_;
  std::vector<Rgb> overlay_scale_;  ///< 1 / mean of each texture
  std::vector<Person> people_;
};

}  // namespace geoflow::simulator
