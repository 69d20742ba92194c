#include "src/sender.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"

#include "src/ray_scene.hpp"
#include "src/steady_tiles.hpp"
#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr unsigned kPlaceBits = 10;  // of a random place within a stratum

/// The middle of one of 2^10 places in 0 … 1, from bits `shift` on.
[[gnu::always_inline]] inline float place(std::uint32_t bits, unsigned shift) {
  constexpr std::uint32_t kPlaces = 1U << kPlaceBits;
  constexpr float kUnit = 1.0F / static_cast<float>(kPlaces);
  return (static_cast<float>(static_cast<int>((bits >> shift) & (kPlaces - 1))) + 0.5F) * kUnit;
}

/// `part` in an order of 0 … parts - 1 turned by a random byte, from bits `shift` on.
[[gnu::always_inline]] inline int turned(int part, int parts, std::uint32_t bits, unsigned shift) {
  constexpr std::uint32_t kByte = 0xff;
  constexpr unsigned kByteBits = 8;
  const int turn = (static_cast<int>((bits >> shift) & kByte) * parts) >> kByteBits;
  const int at = part + turn;
  return at - (at >= parts ? parts : 0);
}

}  // namespace

Sender::Sender(const RayScene& rays, const Pinhole& pinhole, const Shutter& shutter,
               const ViewTrack& track, const Sampling& sampling)
    : pinhole_{pinhole},
      shutter_{shutter},
      track_{&track},
      sampling_{sampling},
      ray_time_begin_{rays.people().ray_time(shutter.begin_s())},
      ray_time_per_s_{(rays.people().ray_time(shutter.end_s()) - ray_time_begin_) /
                      static_cast<float>(shutter.end_s() - shutter.begin_s())} {}

std::vector<Sender::Leg> Sender::legs(int top) const {
  std::vector<Leg> legs;
  const double part_s = shutter_.exposure_s / sampling_.rays_a_pixel;
  for (int part = 0; part < sampling_.rays_a_pixel; ++part) {
    const double before_s = part * part_s - 0.5 * shutter_.exposure_s;
    const int bottom = std::min(top + kTile, shutter_.rows) - 1;
    const double begin_s = shutter_.row_mid_s(top) + before_s;
    const double end_s = shutter_.row_mid_s(bottom) + before_s + part_s;
    Leg leg{.begin = track_->at(begin_s),
            .change = {},
            .begin_s = static_cast<float>(begin_s - shutter_.begin_s()),
            .inverse_span = static_cast<float>(1.0 / (end_s - begin_s))};
    const View end = track_->at(end_s);
    leg.change.R_world_cam = end.R_world_cam - leg.begin.R_world_cam;
    leg.change.p_world_cam = end.p_world_cam - leg.begin.p_world_cam;
    legs.push_back(leg);
  }
  return legs;
}

Sender::PixelBits Sender::pixel_bits(const Tile& tile) const {
  constexpr unsigned kRowBits = 16;
  PixelBits pixels{};
  const auto key = static_cast<std::uint32_t>(sampling_.key);
  with_wide_vectors([&]() __attribute__((always_inline)) {
    for (std::size_t i = 0; i < kPacket; ++i) {
      const auto column = static_cast<std::uint32_t>(tile.left + static_cast<int>(i % kTile));
      const auto row = static_cast<std::uint32_t>(tile.top + static_cast<int>(i / kTile));
      pixels[i] = scramble32(scramble32(((row << kRowBits) | column) ^ key) + key);
    }
  });
  return pixels;
}

void Sender::aim_tile(const Tile& tile, const PixelBits& pixels, int part, const Leg& leg,
                      RayPacket& packet, std::array<int, kPacket>& order) const {
  constexpr std::uint32_t kPartStep = 0x9e3779b9U;  // 2^32 over the golden ratio
  constexpr unsigned kByteBits = 8;
  with_wide_vectors([&]() __attribute__((always_inline)) {
    // Copies, because what lies behind a reference might change with every ray that is written.
    const int number = part;
    const int parts = sampling_.rays_a_pixel;
    const float inverse_parts = 1.0F / static_cast<float>(parts);
    const auto exposure_s = static_cast<float>(shutter_.exposure_s);
    const auto row_s = static_cast<float>(shutter_.readout_s / shutter_.rows);
    const Eigen::Matrix3f from = leg.begin.R_world_cam;
    const Eigen::Matrix3f turn = leg.change.R_world_cam;
    const Vector3f origin = leg.begin.p_world_cam;
    const Vector3f shift = leg.change.p_world_cam;
    const Pinhole pinhole = pinhole_;
    const float begin_s = leg.begin_s;
    const float inverse_span = leg.inverse_span;
    const float ray_time_begin = ray_time_begin_;
    const float ray_time_per_s = ray_time_per_s_;
    const int left = tile.left;
    const int top = tile.top;
    const int last_row = shutter_.rows - 1;
    auto& ray = packet.ray;
    for (std::size_t i = 0; i < kPacket; ++i) {
      const int column = left + static_cast<int>(i % kTile);
      const int below = top + static_cast<int>(i / kTile);
      const int row = below < last_row ? below : last_row;
      const std::uint32_t pixel = pixels[i];
      const std::uint32_t bits = scramble32(pixel + static_cast<std::uint32_t>(number) * kPartStep);
      const auto stratum_x = static_cast<float>(turned(number, parts, pixel, 0));
      const auto stratum_y = static_cast<float>(turned(number, parts, pixel, kByteBits));
      order[i] = turned(number, parts, pixel, 2 * kByteBits);
      const float dx = (stratum_x + place(bits, 0)) * inverse_parts - 0.5F;
      const float dy = (stratum_y + place(bits, kPlaceBits)) * inverse_parts - 0.5F;
      const float when = (static_cast<float>(number) + place(bits, 2 * kPlaceBits)) * inverse_parts;
      const float t_s = exposure_s * when + row_s * (static_cast<float>(row) + 0.5F);
      const float share = (t_s - begin_s) * inverse_span;
      const float x = (static_cast<float>(column) + dx - pinhole.cx) * pinhole.inverse_fx;
      const float y = (static_cast<float>(row) + dy - pinhole.cy) * pinhole.inverse_fy;
      const auto towards = [&](int axis) __attribute__((always_inline)) {
        return from(axis, 0) * x + from(axis, 1) * y + from(axis, 2) +
               share * (turn(axis, 0) * x + turn(axis, 1) * y + turn(axis, 2));
      };
      ray.org_x[i] = origin.x() + share * shift.x();
      ray.org_y[i] = origin.y() + share * shift.y();
      ray.org_z[i] = origin.z() + share * shift.z();
      ray.dir_x[i] = towards(0);
      ray.dir_y[i] = towards(1);
      ray.dir_z[i] = towards(2);
      ray.time[i] = held(ray_time_begin + ray_time_per_s * t_s, 0.0F, 1.0F);
    }
  });
}

void land(unsigned patch, const Vector3f& normal, float height, RayPacket& packet) {
  with_wide_vectors([&]() __attribute__((always_inline)) {
    const float x = normal.x();
    const float y = normal.y();
    const float z = normal.z();
    auto& ray = packet.ray;
    for (std::size_t i = 0; i < kPacket; ++i) {
      const float from = x * ray.org_x[i] + y * ray.org_y[i] + z * ray.org_z[i];
      const float along = x * ray.dir_x[i] + y * ray.dir_y[i] + z * ray.dir_z[i];
      ray.tfar[i] = (height - from) / along;
      packet.hit.geomID[i] = static_cast<unsigned>(HitKind::kPatch);
      packet.hit.primID[i] = patch;
    }
  });
}

}  // namespace geoflow::simulator
