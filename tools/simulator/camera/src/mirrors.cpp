#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/ray_scene.hpp"
#include "src/shader.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr float kInversePi = std::numbers::inv_pi_v<float>;
constexpr float kFaintestMirror = 0.004F;  // below this a reflection is not traced
constexpr float kBrightestGlint = 1.5F;    // of white paper in the same light
constexpr float kFaintest_nit = 1e-6F;
/// How many of a pixel's rays see a mirror image goes by the share that it makes of its light.
constexpr float kFewest = 0.25F;
constexpr float kEager = 0.5F;

/// Schlick's approximation over a cosine.
[[gnu::always_inline]] inline float schlick(float reflectivity, float cosine) noexcept {
  const float grazing = 1.0F - cosine;
  const float power = grazing * grazing * grazing * grazing * grazing;
  return reflectivity + (1.0F - reflectivity) * power;
}

/// Mirrored rays of a whole packet, of which some are wanted; the others' lanes are not set.
struct Bounce {  // NOLINT(cppcoreguidelines-pro-type-member-init)
  std::array<int, kPacket> wanted{};
  Lanes origin_x;
  Lanes origin_y;
  Lanes origin_z;
  Lanes direction_x;
  Lanes direction_y;
  Lanes direction_z;
  Lanes weight;
  Lanes brightest_nit;
};

}  // namespace

float Shader::mirror_reflectance(const Material& material, float cosine) noexcept {
  return material.reflectivity <= 0 ? 0 : schlick(material.reflectivity, cosine);
}

Shader::Gloss Shader::gloss_of(const Valid& valid, const Surfaces& seen) {
  Gloss gloss;
  for (std::size_t i = 0; i < kPacket; ++i) {
    const Material* const material = seen.material[i];
    if (valid[i] == 0 || material == nullptr) {
      continue;
    }
    const float share = mirror_reflectance(*material, seen.cosine[i]);
    gloss.share[i] = share > kFaintestMirror ? share : 0.0F;
    gloss.roughness[i] = material->roughness;
    gloss.received[i] = luminance(seen.irradiance[i]);
  }
  gloss.normal_x = seen.normal_x;
  gloss.normal_y = seen.normal_y;
  gloss.normal_z = seen.normal_z;
  return gloss;
}

Shader::Gloss Shader::gloss_of(const Valid& valid, const Material& material, const Vector3f& normal,
                               const Hits& hits, const LaneColours& irradiance) {
  Gloss gloss;
  gloss.roughness.fill(material.roughness);
  gloss.normal_x.fill(normal.x());
  gloss.normal_y.fill(normal.y());
  gloss.normal_z.fill(normal.z());
  for (std::size_t i = 0; i < kPacket; ++i) {
    const float share = schlick(material.reflectivity, hits.cosine[i]);
    gloss.share[i] = share > kFaintestMirror && valid[i] != 0 ? share : 0.0F;
    gloss.received[i] = luminance(irradiance[i]);
  }
  return gloss;
}

void Shader::mirror(const Gloss& gloss, const RayPacket& packet, const Look& look,
                    Mirrored& mirrored, LaneColours& light) const {
  Bounce bounce;
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // Copies: GCC makes no vectors of what it loads through a constant reference in here.
    const Gloss on = gloss;
    const RTCRay16 ray = packet.ray;
    const std::array<int, kPacket> order = look.order;
    const std::uint64_t all_key = look.key;
    const auto rays_a_pixel = static_cast<float>(look.rays_a_pixel);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const float share = on.share[i];
      const float part = held(kEager * share, kFewest, 1.0F);
      const int rays = -whole_below(-part * rays_a_pixel);
      bounce.wanted[i] = share > 0.0F && order[i] < rays ? 1 : 0;
      bounce.weight[i] = share * rays_a_pixel / static_cast<float>(rays);
      // A lamp's image on a rough mirror is a patch of glints. One ray of a few would make a spark
      // of each: it counts at most as much as blinds the sensor.
      bounce.brightest_nit[i] = kBrightestGlint * on.received[i] * kInversePi / share;
      const std::uint64_t key = subkey(all_key, i);
      const std::uint64_t other = scramble(key);
      float nx = on.normal_x[i] + on.roughness[i] * to_normal(key);
      float ny = on.normal_y[i] + on.roughness[i] * to_normal(other);
      float nz = on.normal_z[i] + on.roughness[i] * to_normal(scramble(key + 1));
      const float inverse_n = 1.0F / std::sqrt(nx * nx + ny * ny + nz * nz);
      nx *= inverse_n;
      ny *= inverse_n;
      nz *= inverse_n;
      const float x = ray.dir_x[i];
      const float y = ray.dir_y[i];
      const float z = ray.dir_z[i];
      const float inverse_d = 1.0F / std::sqrt(x * x + y * y + z * z);
      const float twice = 2.0F * inverse_d * (x * nx + y * ny + z * nz);
      bounce.origin_x[i] = ray.org_x[i] + ray.tfar[i] * x;
      bounce.origin_y[i] = ray.org_y[i] + ray.tfar[i] * y;
      bounce.origin_z[i] = ray.org_z[i] + ray.tfar[i] * z;
      bounce.direction_x[i] = x * inverse_d - twice * nx;
      bounce.direction_y[i] = y * inverse_d - twice * ny;
      bounce.direction_z[i] = z * inverse_d - twice * nz;
    }
  });
  for (std::size_t i = 0; i < kPacket; ++i) {
    light[i] *= 1.0F - gloss.share[i];
    if (bounce.wanted[i] == 0) {
      continue;
    }
    if (mirrored.count == kPacket) {
      see_mirrored(look, mirrored);
    }
    const std::size_t to = mirrored.count++;
    mirrored.lane[to] = i;
    mirrored.weight[to] = bounce.weight[i];
    mirrored.brightest_nit[to] = bounce.brightest_nit[i];
    mirrored.roughness[to] = gloss.roughness[i];
    aim(mirrored.packet, to, {bounce.origin_x[i], bounce.origin_y[i], bounce.origin_z[i]},
        {bounce.direction_x[i], bounce.direction_y[i], bounce.direction_z[i]});
    mirrored.packet.ray.time[to] = packet.ray.time[i];
  }
}

void Shader::see_mirrored(const Look& look, Mirrored& mirrored) const {
  if (mirrored.count == 0) {
    return;
  }
  Valid valid{};
  std::fill_n(valid.begin(), mirrored.count, -1);
  RayPacket& packet = mirrored.packet;
  RayScene::renew(packet);
  rays_->trace(valid, packet);
  const Look from_afar{.footprint_per_t = 2.0F * look.footprint_per_t,
                       .rays_a_pixel = look.rays_a_pixel};
  LaneColours lights;
  if (const unsigned index = only_patch(valid, packet); index != kNoPatch) {
    LaneColours irradiance;
    light_of_patch(index, meet(scene_->patches[index], packet, from_afar, 0), from_afar, irradiance,
                   lights);
  } else {
    const Surfaces image = surfaces(valid, packet, from_afar);
    for (std::size_t i = 0; i < mirrored.count; ++i) {
      lights[i] = light_of(image, packet, i);
    }
  }
  for (std::size_t i = 0; i < mirrored.count; ++i) {
    const float most = mirrored.brightest_nit[i] / std::max(luminance(lights[i]), kFaintest_nit);
    const float weight = mirrored.weight[i];
    Rgb light = lights[i] * (std::min(1.0F, most) * weight);
    light[3] = weight;
    mirrored.light[mirrored.lane[i]] += light;
    mirrored.rough[mirrored.lane[i]] += weight * mirrored.roughness[i];
  }
  mirrored.count = 0;
  mirrored.seen = true;
}

}  // namespace geoflow::simulator
