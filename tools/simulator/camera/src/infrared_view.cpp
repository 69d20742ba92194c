#include "src/infrared_view.hpp"

#include <cstddef>
#include <numbers>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/ray_scene.hpp"
#include "src/shader.hpp"
#include "src/steady_tiles.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kReferenceReflectance = 0.35F;  // of the floor on which the model was fitted
// The pattern's share in what the camera sees falls as daylight, full of infrared, grows past this;
// lamps have little.
constexpr float kDrowningSun_lux = 2000.0F;
constexpr float kTextureWeight = 2.0F;  // a contrast of 0.15 counts as a light wall at 1.8 m
constexpr float kTextureLight_lux =
    15.0F;  // half of the texture's weight: the infrared cameras' noise

float signal_of(const Surfaces& seen, std::size_t lane, float depth_m, float sun_lux,
                float projector_power) {
  const Material& material = *seen.material[lane];
  const float reflectance =
      material.ir_reflectance >= 0 ? material.ir_reflectance : luminance(seen.albedo[lane]);
  const float mirror = Shader::mirror_reflectance(material, seen.cosine[lane]);
  const float diffuse = reflectance * (1.0F - mirror) * (1.0F - mirror);
  const float pattern = projector_power * seen.cosine[lane] * diffuse /
                        (kReferenceReflectance * depth_m * depth_m) /
                        (1.0F + sun_lux / kDrowningSun_lux);
  const float light = luminance(seen.irradiance[lane]) * reflectance +
                      material.emission_nit * std::numbers::pi_v<float>;
  const float texture =
      kTextureWeight * seen.contrast[lane] * (1.0F - mirror) * light / (light + kTextureLight_lux);
  return pattern + texture;
}

}  // namespace

InfraredView see_infrared(const RayScene& rays, const Shader& shader,
                          const CameraIntrinsics& intrinsics, const SE3& T_world_ir, double t_s,
                          float projector_power) {
  const View view{T_world_ir};
  const Pinhole pinhole{intrinsics};
  const auto width = static_cast<std::size_t>(intrinsics.width);
  const float sun_lux = shader.sun_lux();
  const float ray_time = rays.people().ray_time(t_s);
  const SteadyTiles steady{rays, pinhole, Shutter{.t_mid_s = t_s, .rows = intrinsics.height},
                           intrinsics.width,
                           ViewTrack{t_s, t_s, [&](double) { return T_world_ir; }}};
  InfraredView seen;
  seen.depth_m.resize(width * static_cast<std::size_t>(intrinsics.height));
  seen.signal.resize(seen.depth_m.size());
  for_each_tile(intrinsics.width, intrinsics.height, [&](const Tile& tile) {
    RayPacket packet;
    RayScene::reset(packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const Eigen::Vector3f local =
          pinhole.direction(static_cast<float>(tile.x(i)), static_cast<float>(tile.y(i)));
      aim(packet, i, view.p_world_cam, view.R_world_cam * local);
      packet.ray.time[i] = ray_time;
    }
    rays.trace_among(steady.candidates(tile), tile.valid, packet);
    const Surfaces surfaces = shader.surfaces(
        tile.valid, packet, {.footprint_per_t = pinhole.inverse_fx, .contrast = true});
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (surfaces.material[i] == nullptr) {
        continue;
      }
      const std::size_t pixel =
          static_cast<std::size_t>(tile.y(i)) * width + static_cast<std::size_t>(tile.x(i));
      seen.depth_m[pixel] = packet.ray.tfar[i];
      seen.signal[pixel] = signal_of(surfaces, i, packet.ray.tfar[i], sun_lux, projector_power);
    }
  });
  return seen;
}

}  // namespace geoflow::simulator
