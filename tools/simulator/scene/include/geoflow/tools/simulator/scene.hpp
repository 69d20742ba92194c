#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/texture.hpp"

/// Places in which a simulated robot walks: surfaces, lights and people, made at random from a
/// seed. World frame: z up, the floor is z = 0, lengths in metres. Everything here is data,
/// read-only once made; any thread may read it.
namespace geoflow::simulator {

/// How a surface looks in visible light and in the near infrared.
struct Material {
  Rgb albedo{0.5F, 0.5F, 0.5F, 0};  ///< diffuse reflectance, times the texture's
  int texture = -1;                 ///< index of Scene::textures; -1: uniform
  /// A second texture laid over the first at another size, divided by its mean, so that repetition
  /// does not show; -1: none.
  int overlay = -1;
  float reflectivity = 0;  ///< mirror reflectance seen from straight above (Schlick's F0); 0: matt
  float roughness = 0;     ///< standard deviation of the mirror's slope [rad]
  float emission_nit = 0;  ///< luminance of a lamp or a screen [cd/m^2], times albedo and texture
  float ir_reflectance = -1;  ///< at 850 nm; negative: that of the visible luminance
};

/// A planar convex quadrilateral (a triangle repeats its last corner), seen from both sides.
struct Patch {
  std::array<Eigen::Vector3f, 4>
      corners{};  ///< [m] in world, anticlockwise as seen from the normal's side
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();   ///< [m] in world; where (u, v) = 0
  Eigen::Vector3f axis_u = Eigen::Vector3f::UnitX();  ///< unit, in the plane
  Eigen::Vector3f axis_v =
      Eigen::Vector3f::UnitY();            ///< unit, in the plane, normal = axis_u x axis_v
  Eigen::Vector2f size_m{1, 1};            ///< the corners lie in 0 … size_m in (u, v)
  Eigen::Vector2f texture_offset_m{0, 0};  ///< the texture's point at (u, v) = 0
  int material = 0;

  [[nodiscard]] Eigen::Vector3f normal() const { return axis_u.cross(axis_v); }
};

/// A round rod with round ends: a chair's leg, a limb; with equal ends, a ball.
struct Capsule {
  Eigen::Vector3f start = Eigen::Vector3f::Zero();  ///< [m] in world
  Eigen::Vector3f end = Eigen::Vector3f::Zero();    ///< [m] in world
  // NOLINTBEGIN(readability-magic-numbers): named by the members
  float start_radius_m = 0.1F;
  float end_radius_m = 0.1F;
  // NOLINTEND(readability-magic-numbers)
  int material = 0;
};

/// A parallelogram that shines to its normal's side with luminance `luminance_nit` * colour.
struct AreaLight {
  Eigen::Vector3f corner = Eigen::Vector3f::Zero();
  Eigen::Vector3f edge_u = Eigen::Vector3f::UnitX();  ///< [m]
  Eigen::Vector3f edge_v = Eigen::Vector3f::UnitY();  ///< [m]; the light goes to edge_u x edge_v
  Rgb colour{1, 1, 1, 0};
  float luminance_nit = 0;
};

/// Parallel light and the blue sky's.
struct Daylight {
  Eigen::Vector3f to_sun = Eigen::Vector3f::UnitZ();  ///< unit
  float sun_lux = 0;                                  ///< on a plane that faces the sun
  Rgb sun_colour{1, 1, 1, 0};
  float sky_nit = 0;
  Rgb sky_colour{1, 1, 1, 0};
};

/// Someone who walks along a line and back, for ever.
class Pedestrian {
 public:
  struct Walk {
    std::vector<Eigen::Vector2f> waypoints;  ///< [m] in world, at least two, distinct
    // NOLINTBEGIN(readability-magic-numbers): named by the members
    float speed_mps = 1.2F;
    float start_m = 0;  ///< distance along the line at time 0
    float height_m = 1.7F;
    // NOLINTEND(readability-magic-numbers)
    std::array<int, 4> materials{};  ///< skin, top, trousers, shoes
  };
  static constexpr std::size_t kCapsules = 13;

  explicit Pedestrian(Walk walk);

  /// Where the feet's middle is at a time [s].
  [[nodiscard]] Eigen::Vector2f position(double t_s) const;

  /// The body at a time [s]; the same capsules in the same order at all times.
  [[nodiscard]] std::array<Capsule, kCapsules> body(double t_s) const;

 private:
  struct Place {
    Eigen::Vector2f position;
    Eigen::Vector2f heading;
    float distance_m;
  };
  [[nodiscard]] Place place(double t_s) const;

  Walk walk_;
  std::vector<float> lengths_;  ///< along the line, to each waypoint
};

/// What is common to all scenes.
struct SceneOptions {
  double light_level = 1.0;       ///< times the lights of the scene
  double texture_contrast = 1.0;  ///< times the textures' deviation from their mean
  double reflectivity = 1.0;      ///< times the mirror reflectance of floors, glass and cars
  int pedestrians = -1;           ///< how many walk about; -1: as many as the scene has by itself
};

/// The knobs of SceneOptions, "scene.…".
[[nodiscard]] std::span<const Knob<SceneOptions>> scene_knobs();

struct Scene {
  std::string name;
  std::uint64_t seed = 0;
  std::vector<Texture> textures;
  std::vector<Material> materials;
  std::vector<Patch> patches;
  std::vector<Capsule> capsules;
  std::vector<AreaLight> lights;  ///< each also stands in `patches` as a shining surface
  std::optional<Daylight> daylight{};
  /// As many as SceneOptions::pedestrians says.
  std::vector<Pedestrian> pedestrians;
  /// A line on the floor that a robot can walk, at least 0.4 m from everything below 0.6 m [m].
  std::vector<Vector2d> waypoints;
  bool closed = false;  ///< the line's end is its beginning: it can be walked round and round

  [[nodiscard]] std::span<const Vector2d> path() const noexcept { return waypoints; }
};

struct SceneInfo {
  std::string_view name;
  std::string_view summary;
};

/// All scenes that can be made.
[[nodiscard]] std::span<const SceneInfo> scenes();

/// The scene of that name. The same name, seed and options give the same scene; another seed gives
/// another place of the same kind. Pure. Errors: kInvalidArgument for an unknown name, with the
/// nearest known one.
[[nodiscard]] Result<Scene> make_scene(std::string_view name, std::uint64_t seed,
                                       const SceneOptions& options);

}  // namespace geoflow::simulator
