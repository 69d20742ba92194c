#include "replay/scannet/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"

namespace geoflow::drivers::scannet {
namespace {

constexpr std::size_t kChannels = 3;
/// Cameras nearer to each other than this (rad, m) are one: no pixel moves by a hundredth.
constexpr double kSamePlace = 1e-6;

bool same_view(const CameraIntrinsics& a, const CameraIntrinsics& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy;
}

/// The point at depth z [m] on the ray of a pixel position.
Vector3d point_at(const CameraIntrinsics& camera, double u, double v, double z_m) {
  return {(u - camera.cx) / camera.fx * z_m, (v - camera.cy) / camera.fy * z_m, z_m};
}

Vector2d project(const CameraIntrinsics& camera, const Vector3d& p) {
  return {camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy};
}

/// The whole pixels whose centres lie between two positions, cut to the image.
struct PixelRange {
  int first = 0;
  int last = -1;

  PixelRange(double a, double b, int count) {
    const double low = std::max(std::ceil(std::min(a, b)), 0.0);
    const double high = std::min(std::floor(std::max(a, b)), static_cast<double>(count - 1));
    if (low <= high) {
      first = static_cast<int>(low);
      last = static_cast<int>(high);
    }
  }
};

}  // namespace

std::vector<ColorResampler::Footprint> ColorResampler::footprints(double scale, double offset,
                                                                  int count, int source_count) {
  std::vector<Footprint> all;
  const double half = std::max(scale, 1.0) / 2;
  const auto clamped = [source_count](double at) {
    return std::clamp(at, 0.0, static_cast<double>(source_count - 1));
  };
  for (int i = 0; i < count; ++i) {
    const double centre = clamped(scale * i + offset);
    const int first = static_cast<int>(clamped(std::floor(centre - half + 0.5)));
    const int last = static_cast<int>(clamped(std::floor(centre + half + 0.5)));
    Footprint& footprint = all.emplace_back(Footprint{.first = static_cast<std::size_t>(first)});
    double sum = 0;
    for (int pixel = first; pixel <= last; ++pixel) {
      const double covered =
          std::min(pixel + 0.5, centre + half) - std::max(pixel - 0.5, centre - half);
      footprint.weights.push_back(static_cast<float>(std::max(covered, 0.0)));
      sum += std::max(covered, 0.0);
    }
    for (float& weight : footprint.weights) {
      weight /= static_cast<float>(sum);
    }
  }
  return all;
}

ColorResampler::ColorResampler(const CameraIntrinsics& source, const CameraIntrinsics& target)
    : source_width_{static_cast<std::size_t>(source.width)},
      columns_{footprints(source.fx / target.fx, source.cx - source.fx / target.fx * target.cx,
                          target.width, source.width)},
      rows_{footprints(source.fy / target.fy, source.cy - source.fy / target.fy * target.cy,
                       target.height, source.height)} {}

void ColorResampler::add_rows(std::span<const std::byte> image, const Footprint& rows,
                              std::vector<float>& sum) const {
  std::ranges::fill(sum, 0.0F);
  for (std::size_t k = 0; k < rows.weights.size(); ++k) {
    const std::byte* row = image.data() + (rows.first + k) * sum.size();
    for (std::size_t i = 0; i < sum.size(); ++i) {
      sum[i] += rows.weights[k] * static_cast<float>(std::to_integer<int>(row[i]));
    }
  }
}

float ColorResampler::mean_at(const Footprint& columns, const std::vector<float>& row,
                              std::size_t channel) {
  float mean = 0;
  for (std::size_t k = 0; k < columns.weights.size(); ++k) {
    mean += columns.weights[k] * row[(columns.first + k) * kChannels + channel];
  }
  return mean;
}

std::vector<std::byte> ColorResampler::operator()(std::span<const std::byte> image) const {
  std::vector<std::byte> target;
  target.reserve(rows_.size() * columns_.size() * kChannels);
  std::vector<float> mean_row(source_width_ * kChannels);
  for (const Footprint& rows : rows_) {
    add_rows(image, rows, mean_row);
    for (const Footprint& columns : columns_) {
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        const float value = mean_at(columns, mean_row, channel);
        target.push_back(static_cast<std::byte>(std::lround(value)));
      }
    }
  }
  return target;
}

std::vector<std::uint16_t> register_depth(std::span<const std::uint16_t> depth,
                                          const CameraIntrinsics& source,
                                          const CameraIntrinsics& target, const SE3& T_color_depth,
                                          double counts_per_m) {
  if (same_view(source, target) && T_color_depth.log().norm() < kSamePlace) {
    return {depth.begin(), depth.end()};
  }
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  const auto width = static_cast<std::size_t>(target.width);
  std::vector<std::uint16_t> seen(width * static_cast<std::size_t>(target.height), 0);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double z_m = depth[i] / counts_per_m;
    const auto u = static_cast<double>(i % static_cast<std::size_t>(source.width));
    const std::size_t row = i / static_cast<std::size_t>(source.width);
    const auto v = static_cast<double>(row);
    const double counts = (T_color_depth * point_at(source, u, v, z_m)).z() * counts_per_m;
    const Vector3d upper = T_color_depth * point_at(source, u - 0.5, v - 0.5, z_m);
    const Vector3d lower = T_color_depth * point_at(source, u + 0.5, v + 0.5, z_m);
    if (depth[i] == 0 || !(counts >= 1 && counts <= kMost) || !(upper.z() > 0 && lower.z() > 0)) {
      continue;
    }
    const Vector2d a = project(target, upper);
    const Vector2d b = project(target, lower);
    const PixelRange columns{a.x(), b.x(), target.width};
    const PixelRange rows{a.y(), b.y(), target.height};
    const auto value = static_cast<std::uint16_t>(std::lround(counts));
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) {
        std::uint16_t& pixel =
            seen[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)];
        pixel = pixel == 0 ? value : std::min(pixel, value);
      }
    }
  }
  return seen;
}

}  // namespace geoflow::drivers::scannet
