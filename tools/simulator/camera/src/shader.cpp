#include "src/shader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/lighting.hpp"
#include "src/ray_scene.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kInversePi = std::numbers::inv_pi_v<float>;
constexpr float kFlattest = 0.02F;         // cosine below which a footprint does not grow further
constexpr float kFaintestMirror = 0.004F;  // below this a reflection is not traced
constexpr float kShortest_m2 = 1e-8F;
constexpr float kBrightestGlint = 1.5F;  // of white paper in the same light
constexpr float kFaintest_nit = 1e-6F;
constexpr float kBodyRadius_m = 0.26F;
constexpr float kBody_m = 1.0F;  // the height of a body's middle

Vector3f direction_of(const RayPacket& packet, std::size_t lane) {
  return {packet.ray.dir_x[lane], packet.ray.dir_y[lane], packet.ray.dir_z[lane]};
}

}  // namespace

Shader::Shader(const Scene& scene, const RayScene& rays, const Lighting& lighting)
    : scene_{&scene}, rays_{&rays}, lighting_{&lighting} {
  constexpr float kDarkest = 1e-3F;
  for (const Texture& texture : scene.textures) {
    Rgb scale{};
    for (int c = 0; c < 3; ++c) {
      scale[c] = 1.0F / std::max(kDarkest, texture.mean()[c]);
    }
    overlay_scale_.push_back(scale);
  }
}

void Shader::move_people(double t_s) {
  people_.clear();
  for (const Pedestrian& pedestrian : scene_->pedestrians) {
    constexpr float kLongestShadow_m = 4.0F;
    constexpr float kStature_m = 1.7F;
    Person person{.position = pedestrian.position(t_s), .shadow = Vector2f::Zero(), .light = {}};
    person.light = lighting_->around({person.position.x(), person.position.y(), kBody_m}, 0);
    if (scene_->daylight) {
      const Vector3f& sun = scene_->daylight->to_sun;
      const Vector2f away = -sun.head<2>() / std::max(sun.z(), kFlattest);
      person.shadow = away * std::min(kStature_m, kLongestShadow_m / std::max(away.norm(), 1.0F));
    }
    people_.push_back(person);
  }
}

float Shader::person_shadow(const Vector3f& point) const {
  constexpr float kReach_m = 0.5F;  // above the floor
  constexpr float kIndoors =
      0.6F;  // of the light from all sides that feet and legs take from the floor beneath
  constexpr float kSunShare = 0.85F;
  if (point.z() > kReach_m) {
    return 1.0F;
  }
  float light = 1;
  for (const Person& person : people_) {
    const Vector2f from = point.head<2>() - person.position;
    const float length2 = std::max(person.shadow.squaredNorm(), kFlattest);
    const float along = std::clamp(from.dot(person.shadow) / length2, 0.0F, 1.0F);
    const float distance2 = (from - along * person.shadow).squaredNorm();
    const float depth = (scene_->daylight ? kSunShare : kIndoors) * (1.0F - point.z() / kReach_m);
    light *= 1.0F - depth * std::exp(-distance2 / (2.0F * kBodyRadius_m * kBodyRadius_m));
  }
  return light;
}

void Shader::look_at_patch(std::size_t index, const Look& look, float t, Surface& surface) const {
  const Patch& patch = scene_->patches[index];
  const Vector3f from = surface.point - patch.origin;
  const float u = from.dot(patch.axis_u);
  const float v = from.dot(patch.axis_v);
  surface.irradiance = lighting_->on_patch(index, u, v);
  if (!people_.empty()) {
    surface.irradiance *= person_shadow(surface.point);
  }
  const Material& material = *surface.material;
  if (material.texture < 0) {
    return;
  }
  // Jitter spreads a pixel's rays over it both ways, so that each may look finer; the longer axis
  // of the footprint decides.
  constexpr float kSharpening = 0.7F;
  const float facing = t * look.footprint_per_t;
  const float footprint =
      facing * std::max(kSharpening, 1.0F / (std::max(surface.cosine, kFlattest) * look.spread));
  const Texture& texture = scene_->textures[static_cast<std::size_t>(material.texture)];
  const float texture_u = u + patch.texture_offset_m.x();
  const float texture_v = v + patch.texture_offset_m.y();
  surface.albedo *= look.quickly ? texture.sample_quickly(texture_u, texture_v, footprint)
                                 : texture.sample(texture_u, texture_v, footprint);
  if (look.contrast) {
    surface.contrast = texture.contrast(footprint);
  }
  if (material.overlay >= 0) {
    // Turned, so that the two do not repeat together.
    constexpr float kCos = 0.8F;
    constexpr float kSin = 0.6F;
    const auto overlay = static_cast<std::size_t>(material.overlay);
    surface.albedo *=
        scene_->textures[overlay].sample_quickly(kCos * texture_u - kSin * texture_v,
                                                 kSin * texture_u + kCos * texture_v, footprint) *
        overlay_scale_[overlay];
    if (look.contrast) {
      surface.contrast += scene_->textures[overlay].contrast(footprint);
    }
  }
}

Surface Shader::surface(const RayPacket& packet, std::size_t lane, const Look& look) const {
  Surface surface;
  const unsigned kind = packet.hit.geomID[lane];
  if (kind == RTC_INVALID_GEOMETRY_ID) {
    return surface;
  }
  const float t = packet.ray.tfar[lane];
  const Vector3f direction = direction_of(packet, lane);
  surface.point = Vector3f{packet.ray.org_x[lane], packet.ray.org_y[lane], packet.ray.org_z[lane]} +
                  t * direction;
  surface.normal =
      Vector3f{packet.hit.Ng_x[lane], packet.hit.Ng_y[lane], packet.hit.Ng_z[lane]}.normalized();
  const float towards = surface.normal.dot(direction) / direction.norm();
  if (towards > 0) {
    surface.normal = -surface.normal;
  }
  surface.cosine = std::abs(towards);
  const std::size_t primitive = RayScene::primitive(packet, lane);
  const auto use = [&](int material) {
    surface.material = &scene_->materials[static_cast<std::size_t>(material)];
    surface.albedo = surface.material->albedo;
  };
  switch (static_cast<HitKind>(kind)) {
    case HitKind::kPatch:
      use(scene_->patches[primitive].material);
      look_at_patch(primitive, look, t, surface);
      break;
    case HitKind::kCapsule: {
      use(scene_->capsules[primitive].material);
      if (surface.material->texture >= 0) {
        surface.albedo *=
            scene_->textures[static_cast<std::size_t>(surface.material->texture)].mean();
      }
      const auto& [start, end] = lighting_->around_capsule(primitive);
      const Capsule& capsule = scene_->capsules[primitive];
      const Vector3f axis = capsule.end - capsule.start;
      const float along = std::clamp(
          (surface.point - capsule.start).dot(axis) / std::max(axis.squaredNorm(), kShortest_m2),
          0.0F, 1.0F);
      surface.normal = (surface.point - capsule.start - along * axis).normalized();
      surface.irradiance =
          start.at(surface.normal) * (1.0F - along) + end.at(surface.normal) * along;
      break;
    }
    case HitKind::kPerson:
      use(rays_->person_capsule(primitive).material);
      surface.irradiance = people_[primitive / Pedestrian::kCapsules].light.at(surface.normal);
      break;
  }
  return surface;
}

float Shader::mirror_reflectance(const Surface& surface) noexcept {
  const float grazing = 1.0F - surface.cosine;
  const float power = grazing * grazing * grazing * grazing * grazing;
  const float reflectivity = surface.material->reflectivity;
  return reflectivity <= 0 ? 0 : reflectivity + (1.0F - reflectivity) * power;
}

Rgb Shader::diffuse(const Surface& surface) noexcept {
  return surface.albedo * (surface.irradiance * kInversePi + surface.material->emission_nit);
}

void Shader::shade(const std::array<int, kPacket>& valid, const RayPacket& packet, const Look& look,
                   std::array<Rgb, kPacket>& out) const {
  std::array<Surface, kPacket> surfaces;
  bool mirrors = false;
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (valid[i] == 0) {
      continue;
    }
    surfaces[i] = surface(packet, i, look);
    if (surfaces[i].material == nullptr) {
      out[i] = lighting_->sky(direction_of(packet, i).normalized());
    } else {
      out[i] = diffuse(surfaces[i]);
      mirrors = mirrors || mirror_reflectance(surfaces[i]) > kFaintestMirror;
    }
  }
  if (mirrors) {
    add_mirrors(surfaces, packet, look, out);
  }
}

void Shader::add_mirrors(const std::array<Surface, kPacket>& surfaces, const RayPacket& packet,
                         const Look& look, std::array<Rgb, kPacket>& out) const {
  std::array<int, kPacket> valid{};
  RayPacket mirrored;
  RayScene::reset(mirrored);
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (surfaces[i].material == nullptr || mirror_reflectance(surfaces[i]) <= kFaintestMirror) {
      continue;
    }
    valid[i] = -1;
    const float roughness = surfaces[i].material->roughness;
    const std::uint64_t key = subkey(look.key, i);
    const Vector3f tilt{to_normal(key), to_normal(scramble(key)), to_normal(scramble(key + 1))};
    const Vector3f normal = (surfaces[i].normal + roughness * tilt).normalized();
    const Vector3f incoming = direction_of(packet, i).normalized();
    const Vector3f outgoing = incoming - 2.0F * incoming.dot(normal) * normal;
    mirrored.ray.org_x[i] = surfaces[i].point.x();
    mirrored.ray.org_y[i] = surfaces[i].point.y();
    mirrored.ray.org_z[i] = surfaces[i].point.z();
    mirrored.ray.dir_x[i] = outgoing.x();
    mirrored.ray.dir_y[i] = outgoing.y();
    mirrored.ray.dir_z[i] = outgoing.z();
    mirrored.ray.time[i] = packet.ray.time[i];
  }
  rays_->trace(valid, mirrored);
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (valid[i] == 0) {
      continue;
    }
    const Surface seen = surface(
        mirrored, i,
        {.footprint_per_t = 2.0F * look.footprint_per_t, .spread = look.spread, .quickly = true});
    Rgb light =
        seen.material == nullptr ? lighting_->sky(direction_of(mirrored, i)) : diffuse(seen);
    const float share = mirror_reflectance(surfaces[i]);
    // A lamp's image on a rough mirror is a patch of glints. One ray of a few would make a spark of
    // each: it counts at most as much as blinds the sensor.
    const float white = luminance(surfaces[i].irradiance) * kInversePi;
    const float brightness = luminance(light);
    light *= std::min(1.0F, kBrightestGlint * white / std::max(brightness * share, kFaintest_nit));
    out[i] = out[i] * (1.0F - share) + light * share;
  }
}

}  // namespace geoflow::simulator
