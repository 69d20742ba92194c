#include "src/color_view.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/candidates.hpp"
#include "src/glints.hpp"
#include "src/ray_scene.hpp"
#include "src/sender.hpp"
#include "src/shader.hpp"
#include "src/steady_tiles.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

/// Ends a packet's rays: on what the whole tile sees if that is one patch, or on what it may see.
void end_rays(const Subject& subject, const Tile& tile, const Candidates& may, RayPacket& packet) {
  if (may.one_patch()) {
    const std::uint32_t number = may.patches().front();
    const Patch& patch = subject.scene.patches[number];
    const Vector3f normal = patch.normal();
    land(number, normal, normal.dot(patch.origin), packet);
  } else {
    subject.rays.trace_among(may, tile.valid, packet);
  }
}

/// Writes share * sum to the tile's pixels in an image of that width.
template <typename Value>
void put(const Tile& tile, const std::array<Value, kPacket>& sum, float share, std::size_t width,
         std::vector<Value>& image) {
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (tile.valid[i] != 0) {
      image[static_cast<std::size_t>(tile.y(i)) * width + static_cast<std::size_t>(tile.x(i))] =
          sum[i] * share;
    }
  }
}

}  // namespace

std::vector<Rgb> expose(const Subject& subject, const CameraIntrinsics& intrinsics,
                        const Shutter& shutter, const PoseAt& T_world_cam,
                        const Sampling& sampling) {
  const Pinhole pinhole{intrinsics};
  const ViewTrack track{shutter.begin_s(), shutter.end_s(), T_world_cam};
  const Sender sender{subject.rays, pinhole, shutter, track, sampling};
  // To find what tiles may see costs as much as a ray or two a pixel.
  std::optional<SteadyTiles> steady;
  if (!sampling.trace_all && sampling.rays_a_pixel > 2) {
    steady.emplace(subject.rays, pinhole, shutter, intrinsics.width, track);
  }
  Candidates anything;
  anything.add_anything();
  const float share = 1.0F / static_cast<float>(sampling.rays_a_pixel);
  const auto width = static_cast<std::size_t>(intrinsics.width);
  std::vector<Rgb> image(width * static_cast<std::size_t>(intrinsics.height));
  Glints glints{intrinsics.width, intrinsics.height};
  for_each_tile_row(intrinsics.width, intrinsics.height, [&](int top) {
    return [&, legs = sender.legs(top)](const Tile& tile) {
      const Candidates& may = steady ? steady->candidates(tile) : anything;
      const Sender::PixelBits pixels = sender.pixel_bits(tile);
      LaneColours sum{};
      Shader::Mirrored mirrored;
      for (int part = 0; part < sampling.rays_a_pixel; ++part) {
        RayPacket packet;
        RayScene::reset(packet);
        Shader::Look look{.footprint_per_t = pinhole.inverse_fx,
                          .rays_a_pixel = sampling.rays_a_pixel,
                          .dither = (static_cast<float>(part) + 0.5F) * share,
                          .key = subkey(sampling.key + static_cast<std::uint64_t>(part),
                                        static_cast<std::uint64_t>(tile.top) * width +
                                            static_cast<std::uint64_t>(tile.left))};
        sender.aim_tile(tile, pixels, part, legs[static_cast<std::size_t>(part)], packet,
                        look.order);
        end_rays(subject, tile, may, packet);
        subject.shader.shade(tile.valid, packet, look, mirrored, sum);
      }
      subject.shader.see_mirrored(
          {.footprint_per_t = pinhole.inverse_fx, .rays_a_pixel = sampling.rays_a_pixel}, mirrored);
      put(tile, sum, share, width, image);
      if (mirrored.seen) {
        put(tile, mirrored.light, share, width, glints.light);
        put(tile, mirrored.rough, share, width, glints.rough);
      }
    };
  });
  add_glints(glints, static_cast<float>(intrinsics.fy), image);
  return image;
}

std::vector<float> true_depth(const RayScene& rays, const CameraIntrinsics& intrinsics,
                              const SE3& T_world_cam, float ray_time) {
  const View view{T_world_cam};
  const Pinhole pinhole{intrinsics};
  const auto width = static_cast<std::size_t>(intrinsics.width);
  std::vector<float> depth(width * static_cast<std::size_t>(intrinsics.height));
  for_each_tile(intrinsics.width, intrinsics.height, [&](const Tile& tile) {
    RayPacket packet;
    RayScene::reset(packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const Vector3f local =
          pinhole.direction(static_cast<float>(tile.x(i)), static_cast<float>(tile.y(i)));
      aim(packet, i, view.p_world_cam, view.R_world_cam * local);
      packet.ray.time[i] = ray_time;
    }
    rays.trace(tile.valid, packet);
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (tile.valid[i] != 0 && packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
        depth[static_cast<std::size_t>(tile.y(i)) * width + static_cast<std::size_t>(tile.x(i))] =
            packet.ray.tfar[i];
      }
    }
  });
  return depth;
}

float metered_luminance(const Subject& subject, const CameraIntrinsics& intrinsics,
                        const SE3& T_world_cam, double people_t_s) {
  constexpr double kInstant_s = 1e-6;
  constexpr int kColumns = 32;
  constexpr int kRows = 24;
  CameraIntrinsics coarse = intrinsics;
  const double across = static_cast<double>(kColumns) / intrinsics.width;
  const double down = static_cast<double>(kRows) / intrinsics.height;
  coarse.width = kColumns;
  coarse.height = kRows;
  coarse.fx *= across;
  coarse.cx = (coarse.cx + 0.5) * across - 0.5;
  coarse.fy *= down;
  coarse.cy = (coarse.cy + 0.5) * down - 0.5;
  const Shutter still{
      .t_mid_s = people_t_s, .exposure_s = kInstant_s, .readout_s = 0, .rows = kRows};
  const std::vector<Rgb> image =
      expose(subject, coarse, still, [&](double) { return T_world_cam; }, {});
  float sum = 0;
  for (const Rgb& pixel : image) {
    sum += std::sqrt(luminance(pixel));
  }
  const float mean = sum / static_cast<float>(image.size());
  return mean * mean;
}

}  // namespace geoflow::simulator
