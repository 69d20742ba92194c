#include "src/color_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <tbb/parallel_for.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/texture.hpp"

#include "src/ray_scene.hpp"
#include "src/shader.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

/// Views at the borders of each row's subexposures.
class RowViews {
 public:
  RowViews(const Shutter& shutter, const PoseAt& T_world_cam, int parts)
      : parts_{static_cast<std::size_t>(parts)},
        views_(static_cast<std::size_t>(shutter.rows) * (parts_ + 1)) {
    tbb::parallel_for(0, shutter.rows, [&](int row) {
      for (std::size_t border = 0; border <= parts_; ++border) {
        const double share = static_cast<double>(border) / static_cast<double>(parts_) - 0.5;
        views_[at(row, border)] =
            View{T_world_cam(shutter.row_mid_s(row) + share * shutter.exposure_s)};
      }
    });
  }
  /// Border `border` of a row: where subexposure `border` begins and the one before it ends.
  [[nodiscard]] const View& view(int row, std::size_t border) const {
    return views_[at(row, border)];
  }

 private:
  [[nodiscard]] std::size_t at(int row, std::size_t border) const {
    return static_cast<std::size_t>(row) * (parts_ + 1) + border;
  }

  std::size_t parts_;
  std::vector<View> views_;
};

/// Sends one ray of each of a tile's pixels in one subexposure.
class Sender {
 public:
  Sender(const Pinhole& pinhole, const Shutter& shutter, const RowViews& views,
         const Sampling& sampling)
      : pinhole_{pinhole}, shutter_{shutter}, views_{&views}, sampling_{sampling} {}

  void aim_tile(const Tile& tile, int part, RayPacket& packet) const {
    const double span_s = shutter_.end_s() - shutter_.begin_s();
    for (std::size_t i = 0; i < kPacket; ++i) {
      const int row = std::min(tile.y(i), shutter_.rows - 1);
      const std::uint64_t key = subkey(sampling_.key, pixel_number(tile, i));
      // A Latin square: in each of x, y and time every ray has a stratum of its own.
      const float strata = static_cast<float>(sampling_.rays_a_pixel);
      const int turned = (part * kStride + static_cast<int>(key & kTurns)) % sampling_.rays_a_pixel;
      const std::uint64_t bits = scramble(key + static_cast<std::uint64_t>(part) + 1);
      const float x = (static_cast<float>(turned) + to_unit(bits)) / strata - 0.5F;
      const float y = (static_cast<float>(part) + to_unit(bits << kOthers)) / strata - 0.5F;
      const float when = to_unit(bits << (2 * kOthers));
      const View& begin = views_->view(row, static_cast<std::size_t>(part));
      const View& end = views_->view(row, static_cast<std::size_t>(part) + 1);
      const Vector3f local =
          pinhole_.direction(static_cast<float>(tile.x(i)) + x, static_cast<float>(row) + y);
      const Vector3f direction =
          (1.0F - when) * (begin.R_world_cam * local) + when * (end.R_world_cam * local);
      aim(packet, i, begin.p_world_cam + when * (end.p_world_cam - begin.p_world_cam), direction);
      const double t_s =
          shutter_.row_mid_s(row) +
          shutter_.exposure_s * ((static_cast<double>(part) + static_cast<double>(when)) /
                                     static_cast<double>(strata) -
                                 0.5);
      packet.ray.time[i] =
          std::clamp(static_cast<float>((t_s - shutter_.begin_s()) / span_s), 0.0F, 1.0F);
    }
  }

  [[nodiscard]] static std::uint64_t pixel_number(const Tile& tile, std::size_t lane) {
    constexpr unsigned kRowBits = 20;
    return (static_cast<std::uint64_t>(tile.y(lane)) << kRowBits) |
           static_cast<std::uint64_t>(tile.x(lane));
  }

 private:
  static constexpr std::uint64_t kTurns = 0xff;
  static constexpr int kStride = 1;
  static constexpr unsigned kOthers = 20;  // brings bits to the top that differ from those above

  Pinhole pinhole_;
  Shutter shutter_;
  const RowViews* views_;
  Sampling sampling_;
};

}  // namespace

std::vector<Rgb> expose(const RayScene& rays, const Shader& shader,
                        const CameraIntrinsics& intrinsics, const Shutter& shutter,
                        const PoseAt& T_world_cam, const Sampling& sampling) {
  const RowViews views{shutter, T_world_cam, sampling.rays_a_pixel};
  const Pinhole pinhole{intrinsics};
  const Sender sender{pinhole, shutter, views, sampling};
  const float share = 1.0F / static_cast<float>(sampling.rays_a_pixel);
  const auto width = static_cast<std::size_t>(intrinsics.width);
  std::vector<Rgb> image(width * static_cast<std::size_t>(intrinsics.height));
  for_each_tile(intrinsics.width, intrinsics.height, [&](const Tile& tile) {
    std::array<Rgb, kPacket> sum{};
    for (int part = 0; part < sampling.rays_a_pixel; ++part) {
      RayPacket packet;
      RayScene::reset(packet);
      sender.aim_tile(tile, part, packet);
      rays.trace(tile.valid, packet);
      std::array<Rgb, kPacket> light{};
      const std::uint64_t key = subkey(
          sampling.key, Sender::pixel_number(tile, 0) ^ (static_cast<std::uint64_t>(part) << 48U));
      shader.shade(tile.valid, packet,
                   {.footprint_per_t = pinhole.inverse_fx, .spread = 1.0F / share, .key = key},
                   light);
      for (std::size_t i = 0; i < kPacket; ++i) {
        sum[i] += light[i];
      }
    }
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (tile.valid[i] != 0) {
        image[static_cast<std::size_t>(tile.y(i)) * width + static_cast<std::size_t>(tile.x(i))] =
            sum[i] * share;
      }
    }
  });
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

float metered_luminance(const RayScene& rays, const Shader& shader,
                        const CameraIntrinsics& intrinsics, const SE3& T_world_cam) {
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
  const Shutter still{.t_mid_s = 0, .exposure_s = 1, .readout_s = 0, .rows = kRows};
  const std::vector<Rgb> image =
      expose(rays, shader, coarse, still, [&](double) { return T_world_cam; }, {});
  float sum = 0;
  for (const Rgb& pixel : image) {
    sum += std::sqrt(luminance(pixel));
  }
  const float mean = sum / static_cast<float>(image.size());
  return mean * mean;
}

}  // namespace geoflow::simulator
