#include <algorithm>
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

/// How many of a pixel's rays see a mirror image that makes that share of its light.
int mirror_rays(float share, int rays_a_pixel) {
  constexpr float kFewest = 0.25F;
  constexpr float kEager = 2.0F;
  const float part = std::clamp(kEager * share, kFewest, 1.0F);
  return static_cast<int>(std::ceil(part * static_cast<float>(rays_a_pixel)));
}

}  // namespace

float Shader::mirror_reflectance(const Material& material, float cosine) noexcept {
  const float grazing = 1.0F - cosine;
  const float power = grazing * grazing * grazing * grazing * grazing;
  const float reflectivity = material.reflectivity;
  return reflectivity <= 0 ? 0 : reflectivity + (1.0F - reflectivity) * power;
}

void Shader::mirror(const Surfaces& seen, const RayPacket& packet, const Look& look,
                    Mirrored& mirrored, LaneColours& light, LaneColours& sum) const {
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (seen.material[i] == nullptr) {
      continue;
    }
    const float share = mirror_reflectance(*seen.material[i], seen.cosine[i]);
    if (share <= kFaintestMirror) {
      continue;
    }
    light[i] *= 1.0F - share;
    const int rays = mirror_rays(share, look.rays_a_pixel);
    if (look.order[i] >= rays) {
      continue;
    }
    if (mirrored.count == kPacket) {
      add_mirrored(look, mirrored, sum);
    }
    const std::size_t to = mirrored.count++;
    mirrored.lane[to] = i;
    mirrored.weight[to] = share * static_cast<float>(look.rays_a_pixel) / static_cast<float>(rays);
    // A lamp's image on a rough mirror is a patch of glints. One ray of a few would make a spark of
    // each: it counts at most as much as blinds the sensor.
    mirrored.brightest_nit[to] =
        kBrightestGlint * luminance(seen.irradiance[i]) * kInversePi / share;
    const std::uint64_t key = subkey(look.key, i);
    const Vector3f tilt{to_normal(key), to_normal(scramble(key)), to_normal(scramble(key + 1))};
    const Vector3f normal = (Vector3f{seen.normal_x[i], seen.normal_y[i], seen.normal_z[i]} +
                             seen.material[i]->roughness * tilt)
                                .normalized();
    const Vector3f incoming = direction_of(packet, i).normalized();
    aim(mirrored.packet, to, end_of(packet, i), incoming - 2.0F * incoming.dot(normal) * normal);
    mirrored.packet.ray.time[to] = packet.ray.time[i];
  }
}

void Shader::add_mirrored(const Look& look, Mirrored& mirrored, LaneColours& sum) const {
  if (mirrored.count == 0) {
    return;
  }
  Valid valid{};
  std::fill_n(valid.begin(), mirrored.count, -1);
  RayPacket& packet = mirrored.packet;
  RayScene::renew(packet);
  rays_->trace(valid, packet);
  const Surfaces image =
      surfaces(valid, packet,
               {.footprint_per_t = 2.0F * look.footprint_per_t, .rays_a_pixel = look.rays_a_pixel});
  for (std::size_t i = 0; i < mirrored.count; ++i) {
    Rgb light = light_of(image, packet, i);
    light *= std::min(1.0F, mirrored.brightest_nit[i] / std::max(luminance(light), kFaintest_nit));
    sum[mirrored.lane[i]] += light * mirrored.weight[i];
  }
  mirrored.count = 0;
}

}  // namespace geoflow::simulator
