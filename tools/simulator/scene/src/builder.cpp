#include "src/builder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/canvas.hpp"

namespace geoflow::simulator {

Builder Builder::at(const Vector3f& position, float yaw_rad) const {
  Builder moved = *this;
  moved.position_ = to_world(position);
  moved.yaw_rad_ += yaw_rad;
  return moved;
}

Vector3f Builder::to_world(const Vector3f& local) const {
  const float c = std::cos(yaw_rad_);
  const float s = std::sin(yaw_rad_);
  return position_ +
         Vector3f{c * local.x() - s * local.y(), s * local.x() + c * local.y(), local.z()};
}

int Builder::texture(Canvas canvas, float length_m, Repeat repeat) {
  canvas.scale_contrast(static_cast<float>(options_->texture_contrast));
  scene_->textures.emplace_back(canvas.pixels(), canvas.side(), length_m, repeat);
  return static_cast<int>(scene_->textures.size()) - 1;
}

int Builder::material(Material material) {
  material.reflectivity =
      std::min(1.0F, material.reflectivity * static_cast<float>(options_->reflectivity));
  material.emission_nit *= static_cast<float>(options_->light_level);
  scene_->materials.push_back(material);
  return static_cast<int>(scene_->materials.size()) - 1;
}

int Builder::paint(const Rgb& albedo) {
  return material({.albedo = albedo});
}

Patch& Builder::facet(const std::array<Vector3f, 4>& corners, int material) {
  Patch patch;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    patch.corners[i] = to_world(corners[i]);
  }
  const Vector3f along = patch.corners[1] - patch.corners[0];
  const Vector3f normal = along.cross(patch.corners[2] - patch.corners[0]).normalized();
  patch.axis_u = along.normalized();
  patch.axis_v = normal.cross(patch.axis_u);
  Vector2f low = Vector2f::Zero();
  Vector2f high = Vector2f::Zero();
  for (const Vector3f& corner : patch.corners) {
    const Vector3f from = corner - patch.corners[0];
    const Vector2f uv{from.dot(patch.axis_u), from.dot(patch.axis_v)};
    low = low.cwiseMin(uv);
    high = high.cwiseMax(uv);
  }
  patch.origin = patch.corners[0] + low.x() * patch.axis_u + low.y() * patch.axis_v;
  patch.size_m = high - low;
  patch.material = material;
  scene_->patches.push_back(patch);
  return scene_->patches.back();
}

Patch& Builder::quad(const Vector3f& corner, const Vector3f& edge_u, const Vector3f& edge_v,
                     int material) {
  return facet({corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v}, material);
}

void Builder::box(const Vector3f& low, const Vector3f& high, int material, int front) {
  const Vector3f size = high - low;
  const Vector3f x{size.x(), 0, 0};
  const Vector3f y{0, size.y(), 0};
  const Vector3f z{0, 0, size.z()};
  quad(low, x, z, front);
  quad(low + x, y, z, material);
  quad(high - z, -x, z, material);
  quad(low + y, -y, z, material);
  quad(low + z, x, y, material);
}

void Builder::box(const Vector3f& low, const Vector3f& high, int material) {
  box(low, high, material, material);
}

void Builder::prism(std::span<const Vector2f> outline_xz, float low_y, float high_y, int material) {
  const auto point = [&](std::size_t i, float y) {
    const Vector2f& p = outline_xz[i % outline_xz.size()];
    return Vector3f{p.x(), y, p.y()};
  };
  for (std::size_t i = 0; i < outline_xz.size(); ++i) {
    facet({point(i, low_y), point(i, high_y), point(i + 1, high_y), point(i + 1, low_y)}, material);
  }
  for (std::size_t i = 1; i + 1 < outline_xz.size(); i += 2) {
    const std::size_t last = std::min(i + 2, outline_xz.size() - 1);
    facet({point(0, low_y), point(i, low_y), point(i + 1, low_y), point(last, low_y)}, material);
    facet({point(i + 1, high_y), point(i, high_y), point(0, high_y), point(last, high_y)},
          material);
  }
}

void Builder::wheel(const Vector3f& centre, float radius_m, float width_m, int material) {
  constexpr std::size_t kSides = 12;
  std::array<Vector2f, kSides> outline;
  for (std::size_t i = 0; i < kSides; ++i) {
    const float angle =
        2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(kSides);
    outline[i] = {centre.x() + radius_m * std::cos(angle), centre.z() + radius_m * std::sin(angle)};
  }
  prism(outline, centre.y() - 0.5F * width_m, centre.y() + 0.5F * width_m, material);
}

void Builder::rod(const Vector3f& start, const Vector3f& end, float radius_m, int material) {
  scene_->capsules.push_back({.start = to_world(start),
                              .end = to_world(end),
                              .start_radius_m = radius_m,
                              .end_radius_m = radius_m,
                              .material = material});
}

void Builder::lamp(const Vector3f& corner, const Vector3f& edge_u, const Vector3f& edge_v,
                   float luminance_nit, const Rgb& colour) {
  quad(corner, edge_u, edge_v,
       material({.albedo = colour, .emission_nit = luminance_nit, .ir_reflectance = 0.5F}));
  const Vector3f origin = to_world(corner);
  scene_->lights.push_back(
      {.corner = origin,
       .edge_u = to_world(corner + edge_u) - origin,
       .edge_v = to_world(corner + edge_v) - origin,
       .colour = colour,
       .luminance_nit = luminance_nit * static_cast<float>(options_->light_level)});
}

}  // namespace geoflow::simulator
