#include "src/shader.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/lighting.hpp"
#include "src/ray_scene.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kInversePi = std::numbers::inv_pi_v<float>;
constexpr float kFlattest = 0.02F;  // cosine below which a footprint does not grow further
constexpr float kShortest_m2 = 1e-8F;
constexpr float kShadow_m = 0.52F;       // about the feet's middle
constexpr float kShadowHeight_m = 0.5F;  // above the floor
constexpr float kBody_m = 1.0F;          // the height of a body's middle

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

void Shader::dim_by_people(const Hits& hits, LaneColours& irradiance) const {
  constexpr float kIndoors =
      0.6F;  // of the light from all sides that feet and legs take from the floor beneath
  constexpr float kSunShare = 0.85F;
  const float most = scene_->daylight ? kSunShare : kIndoors;
  if (*std::ranges::min_element(hits.z) > kShadowHeight_m) {
    return;
  }
  with_wide_vectors([&]() __attribute__((always_inline)) {
    Lanes light;
    light.fill(1.0F);
    for (const Person& person : people_) {
      const float x = person.position.x();
      const float y = person.position.y();
      const float away_x = person.shadow.x();
      const float away_y = person.shadow.y();
      const float inverse_length2 = 1.0F / std::max(person.shadow.squaredNorm(), kFlattest);
      for (std::size_t i = 0; i < kLanes; ++i) {
        const float from_x = hits.x[i] - x;
        const float from_y = hits.y[i] - y;
        const float along = held((from_x * away_x + from_y * away_y) * inverse_length2, 0.0F, 1.0F);
        const float off_x = from_x - along * away_x;
        const float off_y = from_y - along * away_y;
        const float distance2 = off_x * off_x + off_y * off_y;
        // Falls like a normal curve of half the radius, and ends.
        const float near = held(1.0F - distance2 / (kShadow_m * kShadow_m), 0.0F, 1.0F);
        const float low = held(1.0F - hits.z[i] / kShadowHeight_m, 0.0F, 1.0F);
        light[i] *= 1.0F - most * low * near * near;
      }
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      irradiance[i] *= light[i];
    }
  });
}

Shader::Hits Shader::meet(const Patch& patch, const RayPacket& packet, const Look& look,
                          std::size_t lane) {
  // Jitter spreads a pixel's rays over it both ways, so that each may look finer; the longer axis
  // of the footprint decides.
  constexpr float kSharpening = 0.7F;
  Hits hits;
  const Vector3f normal = patch.normal();
  hits.facing = normal.dot(direction_of(packet, lane)) > 0 ? -1.0F : 1.0F;
  const float inverse_rays = 1.0F / static_cast<float>(look.rays_a_pixel);
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // A copy: GCC makes no vectors of what it loads through a constant reference in here.
    const RTCRay16 ray = packet.ray;
    const float origin_u = patch.origin.dot(patch.axis_u);
    const float origin_v = patch.origin.dot(patch.axis_v);
    const float ux = patch.axis_u.x();
    const float uy = patch.axis_u.y();
    const float uz = patch.axis_u.z();
    const float vx = patch.axis_v.x();
    const float vy = patch.axis_v.y();
    const float vz = patch.axis_v.z();
    const float nx = normal.x();
    const float ny = normal.y();
    const float nz = normal.z();
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float t = ray.tfar[i];
      const float x = ray.org_x[i] + t * ray.dir_x[i];
      const float y = ray.org_y[i] + t * ray.dir_y[i];
      const float z = ray.org_z[i] + t * ray.dir_z[i];
      hits.x[i] = x;
      hits.y[i] = y;
      hits.z[i] = z;
      // Lanes that hit something else must stay within the patch's tables.
      hits.u[i] = held(x * ux + y * uy + z * uz - origin_u, 0.0F, patch.size_m.x());
      hits.v[i] = held(x * vx + y * vy + z * vz - origin_v, 0.0F, patch.size_m.y());
      const float squared =
          ray.dir_x[i] * ray.dir_x[i] + ray.dir_y[i] * ray.dir_y[i] + ray.dir_z[i] * ray.dir_z[i];
      const float towards = nx * ray.dir_x[i] + ny * ray.dir_y[i] + nz * ray.dir_z[i];
      const float cosine = std::abs(towards) / std::sqrt(squared);
      hits.cosine[i] = cosine;
      hits.footprint[i] = t * look.footprint_per_t *
                          std::max(kSharpening, inverse_rays / std::max(cosine, kFlattest));
    }
  });
  return hits;
}

void Shader::paint(const Patch& patch, const Hits& hits, const Look& look, LaneColours& albedo,
                   Lanes& contrast) const {
  // Turned, so that the two do not repeat together.
  constexpr float kCos = 0.8F;
  constexpr float kSin = 0.6F;
  const Material& material = scene_->materials[static_cast<std::size_t>(patch.material)];
  const Texture& texture = scene_->textures[static_cast<std::size_t>(material.texture)];
  Texture::Spots spots{.u_m = {}, .v_m = {}, .footprint_m = hits.footprint};
  for (std::size_t i = 0; i < kLanes; ++i) {
    spots.u_m[i] = hits.u[i] + patch.texture_offset_m.x();
    spots.v_m[i] = hits.v[i] + patch.texture_offset_m.y();
  }
  texture.sample(spots, look.dither, albedo);
  const auto add_contrast = [&](const Texture& of) {
    for (std::size_t i = 0; look.contrast && i < kLanes; ++i) {
      contrast[i] += of.contrast(hits.footprint[i]);
    }
  };
  add_contrast(texture);
  Rgb scale = material.albedo;
  if (material.overlay >= 0) {
    const auto index = static_cast<std::size_t>(material.overlay);
    const Texture& overlay = scene_->textures[index];
    Texture::Spots turned{.u_m = {}, .v_m = {}, .footprint_m = hits.footprint};
    for (std::size_t i = 0; i < kLanes; ++i) {
      turned.u_m[i] = kCos * spots.u_m[i] - kSin * spots.v_m[i];
      turned.v_m[i] = kSin * spots.u_m[i] + kCos * spots.v_m[i];
    }
    LaneColours stains;
    overlay.sample(turned, 0.5F, stains);
    add_contrast(overlay);
    scale *= overlay_scale_[index];
    for (std::size_t i = 0; i < kLanes; ++i) {
      albedo[i] *= stains[i];
    }
  }
  for (Rgb& colour : albedo) {
    colour *= scale;
  }
}

void Shader::light_and_paint(std::size_t index, const Hits& hits, const Look& look,
                             LaneColours& irradiance, LaneColours& albedo, Lanes& contrast) const {
  const Patch& patch = scene_->patches[index];
  const Material& material = scene_->materials[static_cast<std::size_t>(patch.material)];
  lighting_->on_patch(index, hits.u, hits.v, irradiance);
  if (!people_.empty()) {
    dim_by_people(hits, irradiance);
  }
  if (material.texture >= 0) {
    paint(patch, hits, look, albedo, contrast);
  } else {
    albedo.fill(material.albedo);
  }
}

void Shader::look_at_patch(std::size_t index, const Valid& lanes, const RayPacket& packet,
                           const Look& look, Surfaces& seen) const {
  const Patch& patch = scene_->patches[index];
  const Material& material = scene_->materials[static_cast<std::size_t>(patch.material)];
  const auto first = static_cast<std::size_t>(std::ranges::find(lanes, -1) - lanes.begin());
  const Hits hits = meet(patch, packet, look, first);
  // Most packets see one patch.
  const bool whole = std::ranges::count(lanes, -1) == static_cast<std::ptrdiff_t>(kPacket);
  LaneColours other_irradiance;
  LaneColours other_albedo;
  LaneColours& irradiance = whole ? seen.irradiance : other_irradiance;
  LaneColours& albedo = whole ? seen.albedo : other_albedo;
  Lanes contrast{};
  light_and_paint(index, hits, look, irradiance, albedo, contrast);
  const Vector3f normal = hits.facing * patch.normal();
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (lanes[i] == 0) {
      continue;
    }
    seen.material[i] = &material;
    seen.albedo[i] = albedo[i];
    seen.irradiance[i] = irradiance[i];
    seen.normal_x[i] = normal.x();
    seen.normal_y[i] = normal.y();
    seen.normal_z[i] = normal.z();
    seen.cosine[i] = hits.cosine[i];
    seen.contrast[i] = contrast[i];
  }
}

void Shader::look_at_round(std::size_t lane, const RayPacket& packet, Surfaces& seen) const {
  const Vector3f direction = direction_of(packet, lane);
  const std::size_t primitive = RayScene::primitive(packet, lane);
  const bool person = packet.hit.geomID[lane] == static_cast<unsigned>(HitKind::kPerson);
  const Capsule& capsule =
      person ? rays_->people().limbs()[primitive] : scene_->capsules[primitive];
  const Material& material = scene_->materials[static_cast<std::size_t>(capsule.material)];
  Vector3f normal =
      Vector3f{packet.hit.Ng_x[lane], packet.hit.Ng_y[lane], packet.hit.Ng_z[lane]}.normalized();
  const float towards = normal.dot(direction) / direction.norm();
  normal = towards > 0 ? Vector3f{-normal} : normal;
  seen.material[lane] = &material;
  seen.albedo[lane] = material.albedo;
  if (material.texture >= 0) {
    seen.albedo[lane] *= scene_->textures[static_cast<std::size_t>(material.texture)].mean();
  }
  if (person) {
    seen.irradiance[lane] = people_[primitive / Pedestrian::kCapsules].light.at(normal);
  } else {
    const auto& [start, end] = lighting_->around_capsule(primitive);
    const Vector3f axis = capsule.end - capsule.start;
    const Vector3f from = end_of(packet, lane) - capsule.start;
    const float along =
        std::clamp(from.dot(axis) / std::max(axis.squaredNorm(), kShortest_m2), 0.0F, 1.0F);
    normal = (from - along * axis).normalized();
    seen.irradiance[lane] = start.at(normal) * (1.0F - along) + end.at(normal) * along;
  }
  seen.normal_x[lane] = normal.x();
  seen.normal_y[lane] = normal.y();
  seen.normal_z[lane] = normal.z();
  seen.cosine[lane] = std::abs(towards);
}

Surfaces Shader::surfaces(const Valid& valid, const RayPacket& packet, const Look& look) const {
  Surfaces seen;
  Valid left = valid;
  for (std::size_t i = 0; i < kPacket; ++i) {
    const unsigned kind = packet.hit.geomID[i];
    if (left[i] == 0 || kind == RTC_INVALID_GEOMETRY_ID) {
      continue;
    }
    if (kind != static_cast<unsigned>(HitKind::kPatch)) {
      look_at_round(i, packet, seen);
      continue;
    }
    const unsigned patch = packet.hit.primID[i];
    Valid same{};
    for (std::size_t k = 0; k < kPacket; ++k) {
      const bool also = packet.hit.geomID[k] == kind && packet.hit.primID[k] == patch;
      same[k] = also ? left[k] : 0;
      left[k] = also ? 0 : left[k];
    }
    look_at_patch(patch, same, packet, look, seen);
  }
  return seen;
}

Rgb Shader::light_of(const Surfaces& seen, const RayPacket& packet, std::size_t lane) const {
  if (seen.material[lane] == nullptr) {
    return lighting_->sky(direction_of(packet, lane).normalized());
  }
  return seen.albedo[lane] *
         (seen.irradiance[lane] * kInversePi + seen.material[lane]->emission_nit);
}

unsigned Shader::only_patch(const Valid& valid, const RayPacket& packet) {
  const auto first = static_cast<std::size_t>(std::ranges::find(valid, -1) - valid.begin());
  if (first == kPacket || packet.hit.geomID[first] != static_cast<unsigned>(HitKind::kPatch)) {
    return kNoPatch;
  }
  const unsigned index = packet.hit.primID[first];
  unsigned others = 0;
  for (std::size_t i = 0; i < kPacket; ++i) {
    const unsigned other = (packet.hit.primID[i] ^ index) | packet.hit.geomID[i];
    others |= valid[i] != 0 ? other : 0U;
  }
  static_assert(static_cast<unsigned>(HitKind::kPatch) == 0);
  return others == 0 ? index : kNoPatch;
}

void Shader::light_of_patch(unsigned index, const Hits& hits, const Look& look,
                            LaneColours& irradiance, LaneColours& light) const {
  const Patch& patch = scene_->patches[index];
  const Material& material = scene_->materials[static_cast<std::size_t>(patch.material)];
  LaneColours albedo;
  Lanes contrast{};
  light_and_paint(index, hits, look, irradiance, albedo, contrast);
  for (std::size_t i = 0; i < kPacket; ++i) {
    light[i] = albedo[i] * (irradiance[i] * kInversePi + material.emission_nit);
  }
}

void Shader::shade_patch(unsigned index, const Valid& valid, const RayPacket& packet,
                         const Look& look, Mirrored& mirrored, LaneColours& sum) const {
  const Patch& patch = scene_->patches[index];
  const Material& material = scene_->materials[static_cast<std::size_t>(patch.material)];
  const auto first = static_cast<std::size_t>(std::ranges::find(valid, -1) - valid.begin());
  const Hits hits = meet(patch, packet, look, first);
  LaneColours irradiance;
  LaneColours light;
  light_of_patch(index, hits, look, irradiance, light);
  if (material.reflectivity > 0) {
    mirror(gloss_of(valid, material, hits.facing * patch.normal(), hits, irradiance), packet, look,
           mirrored, light);
  }
  for (std::size_t i = 0; i < kPacket; ++i) {
    sum[i] += light[i];
  }
}

void Shader::shade(const Valid& valid, const RayPacket& packet, const Look& look,
                   Mirrored& mirrored, LaneColours& sum) const {
  if (const unsigned index = only_patch(valid, packet); index != kNoPatch) {
    shade_patch(index, valid, packet, look, mirrored, sum);
    return;
  }
  const Surfaces seen = surfaces(valid, packet, look);
  LaneColours light{};
  bool mirrors = false;
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (valid[i] != 0) {
      light[i] = light_of(seen, packet, i);
      mirrors = mirrors || (seen.material[i] != nullptr && seen.material[i]->reflectivity > 0);
    }
  }
  if (mirrors) {
    mirror(gloss_of(valid, seen), packet, look, mirrored, light);
  }
  for (std::size_t i = 0; i < kPacket; ++i) {
    sum[i] += light[i];
  }
}

}  // namespace geoflow::simulator
