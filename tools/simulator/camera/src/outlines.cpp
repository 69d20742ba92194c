#include "src/outlines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/tools/simulator/scene.hpp"

#include "src/tiles.hpp"
#include "src/view.hpp"

namespace geoflow::simulator {
namespace {

using Eigen::Vector3f;

constexpr float kNearest_m = 0.02F;
constexpr float kBeyond_px = 16.0F;  // how far beyond the image outlines are followed

}  // namespace

Outlines::Outlines(const Pinhole& pinhole, std::span<const View> row_views, int columns)
    : pinhole_{pinhole}, row_views_{row_views}, columns_{columns} {}

int Outlines::row_of(float y) const noexcept {
  const auto last = static_cast<float>(row_views_.size() - 1);
  return static_cast<int>(std::clamp((y + 0.5F) / static_cast<float>(kTile), 0.0F, last));
}

Outlines::Place Outlines::place(const Vector3f& p_world) const {
  Place place{.x = 0,
              .y = 0.5F * static_cast<float>(kTile) * static_cast<float>(row_views_.size()),
              .inverse_m = 1};
  // The row decides the view, and the view the row: two steps find it within a fraction of a pixel.
  for (int step = 0; step < 2; ++step) {
    const View& view = row_views_[static_cast<std::size_t>(row_of(place.y))];
    const Vector3f p = view.R_world_cam.transpose() * (p_world - view.p_world_cam);
    place.inverse_m = 1.0F / std::max(p.z(), kNearest_m);
    place.x = p.x() * place.inverse_m / pinhole_.inverse_fx + pinhole_.cx;
    place.y = p.y() * place.inverse_m / pinhole_.inverse_fy + pinhole_.cy;
  }
  return place;
}

void Outlines::of(const Patch& patch, std::vector<Crossing>& out) const {
  for (std::size_t i = 0; i < patch.corners.size(); ++i) {
    walk(patch.corners[i], patch.corners[(i + 1) % patch.corners.size()], out);
  }
}

void Outlines::walk(const Vector3f& from, const Vector3f& to, std::vector<Crossing>& out) const {
  const View& view = row_views_[row_views_.size() / 2];
  const Vector3f a = view.R_world_cam.transpose() * (from - view.p_world_cam);
  const Vector3f b = view.R_world_cam.transpose() * (to - view.p_world_cam);
  // The part of the line within the image: before the camera and on the inner side of four planes
  // through it.
  const float left = -(pinhole_.cx + kBeyond_px) * pinhole_.inverse_fx;
  const float top = -(pinhole_.cy + kBeyond_px) * pinhole_.inverse_fy;
  const auto width = static_cast<float>(columns_ * kTile);
  const auto height = static_cast<float>(kTile) * static_cast<float>(row_views_.size());
  const float right = (width + kBeyond_px - pinhole_.cx) * pinhole_.inverse_fx;
  const float bottom = (height + kBeyond_px - pinhole_.cy) * pinhole_.inverse_fy;
  const auto sides = [&](const Vector3f& p) {
    return std::array{p.z() - kNearest_m, p.x() - left * p.z(), right * p.z() - p.x(),
                      p.y() - top * p.z(), bottom * p.z() - p.y()};
  };
  float begin = 0;
  float end = 1;
  const auto side_a = sides(a);
  const auto side_b = sides(b);
  for (std::size_t i = 0; i < side_a.size(); ++i) {
    if (side_a[i] < 0 && side_b[i] < 0) {
      return;
    }
    const float crossing = side_a[i] / (side_a[i] - side_b[i]);
    begin = side_a[i] < 0 ? std::max(begin, crossing) : begin;
    end = side_b[i] < 0 ? std::min(end, crossing) : end;
  }
  if (begin >= end) {
    return;
  }
  const Place first = place(from + begin * (to - from));
  const Place last = place(from + end * (to - from));
  const float length_px = std::max(std::abs(last.x - first.x), std::abs(last.y - first.y));
  const int steps = 1 + static_cast<int>(length_px / static_cast<float>(kTile));
  for (int step = 0; step <= steps; ++step) {
    const float share = static_cast<float>(step) / static_cast<float>(steps);
    const Place at{.x = first.x + share * (last.x - first.x),
                   .y = first.y + share * (last.y - first.y),
                   .inverse_m = first.inverse_m + share * (last.inverse_m - first.inverse_m)};
    fill(at, 0, out);
  }
}

void Outlines::of(const Capsule& capsule, float travel_m, std::vector<Crossing>& out) const {
  const float radius_m = std::max(capsule.start_radius_m, capsule.end_radius_m) + travel_m;
  const View& view = row_views_[row_views_.size() / 2];
  const Vector3f axis_z = view.R_world_cam.col(2);
  const auto depth = [&](const Vector3f& p) { return axis_z.dot(p - view.p_world_cam); };
  const float farther_m = std::max(depth(capsule.start), depth(capsule.end));
  if (farther_m + radius_m < kNearest_m) {
    return;
  }
  // Balls in a row, each reaching the next one's middle.
  const float length_m = (capsule.end - capsule.start).norm();
  const int balls = 1 + static_cast<int>(length_m / radius_m);
  for (int ball = 0; ball <= balls; ++ball) {
    const float share = static_cast<float>(ball) / static_cast<float>(balls);
    const Vector3f centre = capsule.start + share * (capsule.end - capsule.start);
    const float nearest_m = std::max(depth(centre) - radius_m, kNearest_m);
    if (depth(centre) + radius_m < kNearest_m) {
      continue;
    }
    Place at = place(centre);
    at.inverse_m = 1.0F / nearest_m;
    fill(at, radius_m * at.inverse_m / pinhole_.inverse_fx, out);
  }
}

void Outlines::fill(const Place& centre, float radius_px, std::vector<Crossing>& out) const {
  const auto tile = [](float px) {
    return static_cast<int>(std::floor((px + 0.5F) / static_cast<float>(kTile)));
  };
  const auto rows = static_cast<float>(row_views_.size());
  const auto most_x = static_cast<float>(columns_ * kTile);
  const float most_y = static_cast<float>(kTile) * rows;
  const auto held_x = [&](float px) { return std::clamp(px, -1.0F, most_x); };
  const auto held_y = [&](float px) { return std::clamp(px, -1.0F, most_y); };
  const int right = std::min(columns_ - 1, tile(held_x(centre.x + radius_px)));
  const int bottom =
      std::min(static_cast<int>(row_views_.size()) - 1, tile(held_y(centre.y + radius_px)));
  for (int row = std::max(0, tile(held_y(centre.y - radius_px))); row <= bottom; ++row) {
    for (int column = std::max(0, tile(held_x(centre.x - radius_px))); column <= right; ++column) {
      out.push_back({.tile = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                             static_cast<std::size_t>(column),
                     .depth_m = 1.0F / centre.inverse_m});
    }
  }
}

}  // namespace geoflow::simulator
