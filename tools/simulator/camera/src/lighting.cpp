#include "src/lighting.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/ray_scene.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kSmallestTexel_m = 0.06F;
constexpr float kMostTexels = 150'000;
constexpr int kLightSamples = 2;      // each way over a lamp
constexpr int kCoarse = 4;            // indirect light is gathered at every fourth texel each way
constexpr std::size_t kGather = 128;  // rays over the hemisphere
constexpr float kSurface_m = 2e-3F;

/// Low-discrepancy cosine-weighted directions about z (Hammersley's points; Malley's method).
const std::array<Vector3f, kGather>& hemisphere() {
  static const std::array<Vector3f, kGather> directions = [] {
    std::array<Vector3f, kGather> made;
    for (std::size_t i = 0; i < kGather; ++i) {
      float reversed = 0;
      float digit = 0.5F;
      for (std::size_t bits = i; bits != 0; bits >>= 1U) {
        reversed += (bits & 1U) != 0 ? digit : 0.0F;
        digit *= 0.5F;
      }
      const float radius = std::sqrt((static_cast<float>(i) + 0.5F) / static_cast<float>(kGather));
      const float turn = 2.0F * kPi * reversed;
      made[i] = {radius * std::cos(turn), radius * std::sin(turn),
                 std::sqrt(std::max(0.0F, 1.0F - radius * radius))};
    }
    return made;
  }();
  return directions;
}

/// Irradiance of one lamp at a point, without other lamps.
Rgb lamp_light(const AreaLight& lamp, const RayScene& rays, const Vector3f& point,
               const Vector3f& normal) {
  const Vector3f area = lamp.edge_u.cross(lamp.edge_v);
  const Vector3f facing = area.normalized();
  if ((point - lamp.corner).dot(facing) <= 0.0F) {
    return Rgb{};
  }
  float sum = 0;
  for (int i = 0; i < kLightSamples * kLightSamples; ++i) {
    const int column = i % kLightSamples;
    const int row = i / kLightSamples;
    const float u = (static_cast<float>(column) + 0.5F) / static_cast<float>(kLightSamples);
    const float v = (static_cast<float>(row) + 0.5F) / static_cast<float>(kLightSamples);
    const Vector3f at = lamp.corner + u * lamp.edge_u + v * lamp.edge_v;
    const Vector3f way = at - point;
    const float squared = way.squaredNorm();
    const float distance = std::sqrt(squared);
    const float received = normal.dot(way) / distance;
    const float emitted = -facing.dot(way) / distance;
    if (received > 0.0F && emitted > 0.0F && !rays.blocked(point, at + kSurface_m * facing)) {
      sum += received * emitted / squared;
    }
  }
  return lamp.colour * (lamp.luminance_nit * area.norm() * sum /
                        static_cast<float>(kLightSamples * kLightSamples));
}

}  // namespace

Rgb LightCube::at(const Vector3f& normal) const noexcept {
  Rgb sum{};
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t side = 2 * static_cast<std::size_t>(axis) + (normal[axis] < 0 ? 1 : 0);
    sum += sides[side] * (normal[axis] * normal[axis]);
  }
  return sum;
}

Lighting::Lighting(const Scene& scene, const RayScene& rays) : scene_{&scene}, rays_{&rays} {
  for (const Material& material : scene.materials) {
    mean_albedo_.push_back(
        material.texture < 0
            ? material.albedo
            : material.albedo * scene.textures[static_cast<std::size_t>(material.texture)].mean());
  }
  lay_out_maps();
  bake_direct();
  bake_indirect();
  capsules_.resize(scene.capsules.size());
  tbb::parallel_for(std::size_t{0}, capsules_.size(), [&](std::size_t i) {
    const Capsule& capsule = scene.capsules[i];
    capsules_[i] = {around(capsule.start, capsule.start_radius_m),
                    around(capsule.end, capsule.end_radius_m)};
  });
}

void Lighting::lay_out_maps() {
  constexpr float kMostReflected = 0.7F;
  float area = 0;
  float reflecting = 0;
  for (const Patch& patch : scene_->patches) {
    const float size = patch.size_m.prod();
    area += size;
    reflecting += size * luminance(mean_albedo_[static_cast<std::size_t>(patch.material)]);
  }
  further_bounces_ =
      scene_->daylight ? 1.0F : 1.0F / (1.0F - std::min(kMostReflected, reflecting / area));
  const float texel = std::max(kSmallestTexel_m, std::sqrt(area / kMostTexels));
  std::size_t next = 0;
  for (const Patch& patch : scene_->patches) {
    Map map{.columns = std::max(2, static_cast<int>(patch.size_m.x() / texel)),
            .rows = std::max(2, static_cast<int>(patch.size_m.y() / texel)),
            .first = next};
    map.columns_per_m = static_cast<float>(map.columns) / patch.size_m.x();
    map.rows_per_m = static_cast<float>(map.rows) / patch.size_m.y();
    next += static_cast<std::size_t>(map.columns) * static_cast<std::size_t>(map.rows);
    maps_.push_back(map);
  }
  texels_.resize(next);
}

Rgb Lighting::direct(const Vector3f& point, const Vector3f& normal) const {
  Rgb sum{};
  for (const AreaLight& lamp : scene_->lights) {
    sum += lamp_light(lamp, *rays_, point, normal);
  }
  if (scene_->daylight) {
    constexpr float kFar_m = 500.0F;
    const float cosine = normal.dot(scene_->daylight->to_sun);
    if (cosine > 0.0F && !rays_->blocked(point, point + kFar_m * scene_->daylight->to_sun)) {
      sum += scene_->daylight->sun_colour * (scene_->daylight->sun_lux * cosine);
    }
  }
  return sum;
}

void Lighting::bake_direct() {
  tbb::parallel_for(std::size_t{0}, maps_.size(), [&](std::size_t i) {
    const Map& map = maps_[i];
    const Patch& patch = scene_->patches[i];
    const Vector3f normal = patch.normal();
    tbb::parallel_for(0, map.rows, [&](int row) {
      for (int column = 0; column < map.columns; ++column) {
        const Vector3f point =
            patch.origin + (static_cast<float>(column) + 0.5F) / map.columns_per_m * patch.axis_u +
            (static_cast<float>(row) + 0.5F) / map.rows_per_m * patch.axis_v + kSurface_m * normal;
        texels_[map.first + static_cast<std::size_t>(row) * static_cast<std::size_t>(map.columns) +
                static_cast<std::size_t>(column)] = direct(point, normal);
      }
    });
  });
}

Rgb Lighting::sky(const Vector3f& direction) const noexcept {
  if (!scene_->daylight) {
    return Rgb{};
  }
  // Brighter and paler towards the horizon.
  constexpr float kHorizon = 0.8F;
  const float up = std::clamp(direction.z(), 0.0F, 1.0F);
  const float low = (1.0F - up) * (1.0F - up);
  const Rgb white{1, 1, 1, 0};
  const Rgb colour =
      scene_->daylight->sky_colour * (1.0F - kHorizon * low) + white * (kHorizon * low);
  return colour * (scene_->daylight->sky_nit * (1.0F + low));
}

Rgb Lighting::reflected(const RayPacket& packet, std::size_t lane) const {
  if (packet.hit.geomID[lane] != static_cast<unsigned>(HitKind::kPatch)) {
    const bool missed = packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID;
    return missed ? sky({packet.ray.dir_x[lane], packet.ray.dir_y[lane], packet.ray.dir_z[lane]})
                  : Rgb{};
  }
  const std::size_t index = packet.hit.primID[lane];
  const Patch& patch = scene_->patches[index];
  const Vector3f direction{packet.ray.dir_x[lane], packet.ray.dir_y[lane], packet.ray.dir_z[lane]};
  const Vector3f from{packet.ray.org_x[lane], packet.ray.org_y[lane], packet.ray.org_z[lane]};
  const Vector3f at = from + packet.ray.tfar[lane] * direction - patch.origin;
  return on_patch(index, at.dot(patch.axis_u), at.dot(patch.axis_v)) *
         mean_albedo_[static_cast<std::size_t>(patch.material)] * (1.0F / kPi);
}

Rgb Lighting::indirect(const Vector3f& point, const Vector3f& normal, float clear_radius_m) const {
  constexpr float kSteep = 0.9F;
  const Vector3f side = (std::abs(normal.z()) < kSteep ? Vector3f::UnitZ() : Vector3f::UnitX())
                            .cross(normal)
                            .normalized();
  const Vector3f other = normal.cross(side);
  Valid valid;
  valid.fill(-1);
  Rgb sum{};
  for (std::size_t first = 0; first < kGather; first += kPacket) {
    RayPacket packet;
    RayScene::reset(packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const Vector3f& local = hemisphere()[first + i];
      const Vector3f direction = local.x() * side + local.y() * other + local.z() * normal;
      packet.ray.org_x[i] = point.x();
      packet.ray.org_y[i] = point.y();
      packet.ray.org_z[i] = point.z();
      packet.ray.dir_x[i] = direction.x();
      packet.ray.dir_y[i] = direction.y();
      packet.ray.dir_z[i] = direction.z();
      packet.ray.tnear[i] = clear_radius_m + kSurface_m;
    }
    rays_->trace_static(valid, packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      sum += reflected(packet, i);
    }
  }
  return sum * (kPi * further_bounces_ / static_cast<float>(kGather));
}

void Lighting::bake_indirect() {
  std::vector<Rgb> with_indirect = texels_;
  tbb::parallel_for(std::size_t{0}, maps_.size(), [&](std::size_t index) {
    const Map& map = maps_[index];
    const Patch& patch = scene_->patches[index];
    const Vector3f normal = patch.normal();
    const int columns = (map.columns - 1) / kCoarse + 2;
    const int rows = (map.rows - 1) / kCoarse + 2;
    std::vector<Rgb> coarse(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    const auto node = [&](int column, int row) -> Rgb& {
      return coarse[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                    static_cast<std::size_t>(column)];
    };
    tbb::parallel_for(0, rows, [&](int row) {
      for (int column = 0; column < columns; ++column) {
        const float x =
            std::min(static_cast<float>(kCoarse * column), static_cast<float>(map.columns - 1)) +
            0.5F;
        const float y =
            std::min(static_cast<float>(kCoarse * row), static_cast<float>(map.rows - 1)) + 0.5F;
        const Vector3f point =
            patch.origin + x / map.columns_per_m * patch.axis_u + y / map.rows_per_m * patch.axis_v;
        node(column, row) = indirect(point + kSurface_m * normal, normal, 0);
      }
    });
    for (int row = 0; row < map.rows; ++row) {
      for (int column = 0; column < map.columns; ++column) {
        const float fx = static_cast<float>(column % kCoarse) / static_cast<float>(kCoarse);
        const float fy = static_cast<float>(row % kCoarse) / static_cast<float>(kCoarse);
        const int x = column / kCoarse;
        const int y = row / kCoarse;
        with_indirect[map.first +
                      static_cast<std::size_t>(row) * static_cast<std::size_t>(map.columns) +
                      static_cast<std::size_t>(column)] +=
            (node(x, y) * (1.0F - fx) + node(x + 1, y) * fx) * (1.0F - fy) +
            (node(x, y + 1) * (1.0F - fx) + node(x + 1, y + 1) * fx) * fy;
      }
    }
  });
  texels_ = std::move(with_indirect);
}

Rgb Lighting::on_patch(std::size_t patch, float u, float v) const noexcept {
  const Map& map = maps_[patch];
  const float x =
      std::clamp(u * map.columns_per_m - 0.5F, 0.0F, static_cast<float>(map.columns - 1));
  const float y = std::clamp(v * map.rows_per_m - 0.5F, 0.0F, static_cast<float>(map.rows - 1));
  const int x0 = std::min(static_cast<int>(x), map.columns - 2);
  const int y0 = std::min(static_cast<int>(y), map.rows - 2);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const Rgb* low =
      &texels_[map.first + static_cast<std::size_t>(y0) * static_cast<std::size_t>(map.columns) +
               static_cast<std::size_t>(x0)];
  const Rgb* high = low + map.columns;
  return (low[0] * (1.0F - fx) + low[1] * fx) * (1.0F - fy) +
         (high[0] * (1.0F - fx) + high[1] * fx) * fy;
}

void Lighting::on_patch(std::size_t patch, const Lanes& u, const Lanes& v,
                        LaneColours& out) const noexcept {
  const Map map = maps_[patch];
  const Rgb* texels = &texels_[map.first];
  with_wide_vectors([&]() __attribute__((always_inline)) {
    const auto most_x = static_cast<float>(map.columns - 1);
    const auto most_y = static_cast<float>(map.rows - 1);
    Taps taps;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float x = held(u[i] * map.columns_per_m - 0.5F, 0.0F, most_x);
      const float y = held(v[i] * map.rows_per_m - 0.5F, 0.0F, most_y);
      const int x0 = std::min(static_cast<int>(x), map.columns - 2);
      const int y0 = std::min(static_cast<int>(y), map.rows - 2);
      taps.weigh(i, x - static_cast<float>(x0), y - static_cast<float>(y0));
      const auto first = static_cast<std::uint32_t>(y0 * map.columns + x0);
      const auto columns = static_cast<std::uint32_t>(map.columns);
      taps.index[0][i] = first;
      taps.index[1][i] = first + 1;
      taps.index[2][i] = first + columns;
      taps.index[3][i] = first + columns + 1;
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
      out[i] =
          taps.mix(i, [&](std::uint32_t at) __attribute__((always_inline)) { return texels[at]; });
    }
  });
}

LightCube Lighting::around(const Vector3f& point, float clear_radius_m) const {
  LightCube cube;
  for (std::size_t side = 0; side < cube.sides.size(); ++side) {
    Vector3f normal = Vector3f::Zero();
    normal[static_cast<int>(side / 2)] = side % 2 == 0 ? 1.0F : -1.0F;
    cube.sides[side] =
        direct(point + clear_radius_m * normal, normal) + indirect(point, normal, clear_radius_m);
  }
  return cube;
}

}  // namespace geoflow::simulator
