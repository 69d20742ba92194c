#pragma once

#include <array>
#include <span>

#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/canvas.hpp"

namespace geoflow::simulator {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// Puts a scene together. Shapes are given in the coordinates of a placement: moved to a point of
/// the world and turned about the vertical.
class Builder {
 public:
  Builder(Scene& scene, const SceneOptions& options) : scene_{&scene}, options_{&options} {}

  /// The same builder with its origin at `position` of this one's coordinates [m], turned by
  /// `yaw_rad`.
  [[nodiscard]] Builder at(const Vector3f& position, float yaw_rad = 0) const;

  /// Adds a texture of `length_m` a side; contrast as the options say. Its index.
  int texture(Canvas canvas, float length_m, Repeat repeat = Repeat::kTile);
  /// Adds a material; reflectivity and emission as the options say. Its index.
  int material(Material material);
  /// A uniform matt one.
  int paint(const Rgb& albedo);

  /// The parallelogram at `corner` with two edges, one of which is perpendicular to the other; the
  /// normal is u x v.
  Patch& quad(const Vector3f& corner, const Vector3f& edge_u, const Vector3f& edge_v, int material);
  /// A triangle or convex quadrilateral (repeat the third corner for a triangle); u runs along its
  /// first edge.
  Patch& facet(const std::array<Vector3f, 4>& corners, int material);
  /// An axis-parallel box from `low` to `high` without its underside.
  void box(const Vector3f& low, const Vector3f& high, int material);
  /// The same with a material for its front (at low y).
  void box(const Vector3f& low, const Vector3f& high, int material, int front);
  /// A convex outline in x and z, anticlockwise as seen from -y, drawn out from y = low to y =
  /// high.
  void prism(std::span<const Vector2f> outline_xz, float low_y, float high_y, int material);
  /// A disc about (0, y, 0) parallel to the xz plane, drawn out, of 12 sides: a wheel.
  void wheel(const Vector3f& centre, float radius_m, float width_m, int material);
  void rod(const Vector3f& start, const Vector3f& end, float radius_m, int material);
  /// A lamp: a quad that shines to its normal's side with `luminance_nit`.
  void lamp(const Vector3f& corner, const Vector3f& edge_u, const Vector3f& edge_v,
            float luminance_nit, const Rgb& colour);

  [[nodiscard]] Scene& scene() const noexcept { return *scene_; }
  [[nodiscard]] const SceneOptions& options() const noexcept { return *options_; }
  [[nodiscard]] Vector3f to_world(const Vector3f& local) const;

 private:
  Scene* scene_;
  const SceneOptions* options_;
  Vector3f position_ = Vector3f::Zero();
  float yaw_rad_ = 0;
};

}  // namespace geoflow::simulator
