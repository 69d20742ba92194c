#include "d435i/pixels/registration.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::d435i {
namespace {

Matrix3d camera_matrix(const CameraIntrinsics& camera) {
  Matrix3d K;
  K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  return K;
}

std::size_t pixels_of(const CameraIntrinsics& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

/// The pixels whose centres lie on [from, to], of those from 0 to size - 1.
struct Span {
  int first;
  int end;
};
Span centres(float from, float to, int size) {
  // Clamped first: positions beyond the image may be beyond what an int holds. Rounded by
  // conversion, as ceil and floor are calls on processors without SSE 4.1.
  const auto end = static_cast<float>(size);
  const float begin = std::clamp(from, 0.0F, end);
  const int truncated = static_cast<int>(begin);
  return {truncated + static_cast<int>(static_cast<float>(truncated) < begin),
          static_cast<int>(std::clamp(to + 1, 0.0F, end))};
}

bool same_surface(float w0, float w1) {
  const float nearer = std::max(w0, w1);
  const float farther = std::min(w0, w1);
  // z1 - z0 <= r z0 with z = 1 / w
  return farther > 0 && nearer - farther <= DepthRegistration::kTornRatio * farther;
}

}  // namespace

Result<DepthRegistration> DepthRegistration::create(const RegistrationGeometry& geometry) {
  const auto usable = [](const CameraIntrinsics& camera) {
    return camera.width > 0 && camera.height > 0 && camera.fx > 0 && camera.fy > 0;
  };
  if (!usable(geometry.depth) || !usable(geometry.color) || geometry.depth_unit_m <= 0) {
    return fail(ErrorCode::kInvalidArgument,
                "registration of depth: a size, focal length or unit is not positive");
  }
  if (geometry.depth.model != DistortionModel::kNone ||
      geometry.color.model == DistortionModel::kEquidistant) {
    return fail(ErrorCode::kInvalidArgument,
                "registration of depth: only the colour camera may be distorted, by radtan");
  }
  return DepthRegistration{geometry};
}

DepthRegistration::DepthRegistration(const RegistrationGeometry& geometry)
    : geometry_{geometry},
      depth_row_(static_cast<std::size_t>(geometry.depth.width)),
      projected_{static_cast<std::size_t>(geometry.depth.width)},
      above_{static_cast<std::size_t>(geometry.color.width)},
      below_{static_cast<std::size_t>(geometry.color.width)},
      joined_(static_cast<std::size_t>(geometry.color.width)),
      inverse_(pixels_of(geometry.color)) {
  const CameraIntrinsics& depth = geometry.depth;
  const CameraIntrinsics& color = geometry.color;
  // A distorted camera's points are projected to its normalised plane first.
  const Matrix3d K =
      color.model == DistortionModel::kNone ? camera_matrix(color) : Matrix3d::Identity();
  R_pixel_depth_ = (K * geometry.T_cam_depth.rotation_matrix()).cast<float>();
  p_pixel_depth_ = (K * geometry.T_cam_depth.translation() / geometry.depth_unit_m).cast<float>();
  half_pitch_px_ = Vector2d{color.fx / depth.fx / 2, color.fy / depth.fy / 2}.cast<float>();
  ray_x_.reserve(projected_.x.size());
  for (int u = 0; u < depth.width; ++u) {
    ray_x_.push_back(static_cast<float>((u - depth.cx) / depth.fx));
  }
}

Result<void> DepthRegistration::run(std::span<const std::byte> depth,
                                    std::span<std::uint16_t> target) {
  const std::size_t row_bytes = depth_row_.size() * sizeof(std::uint16_t);
  if (depth.size() != pixels_of(geometry_.depth) * sizeof(std::uint16_t) ||
      target.size() != pixels_of(geometry_.color)) {
    return fail(ErrorCode::kInvalidData,
                "registration of {} bytes of depth to {} pixels, set up for {} and {} pixels",
                depth.size(), target.size(), pixels_of(geometry_.depth),
                pixels_of(geometry_.color));
  }
  std::ranges::fill(inverse_, 0.0F);
  std::ranges::fill(above_.w, 0.0F);
  std::ranges::fill(joined_, char{0});
  for (int v = 0; v < geometry_.depth.height; ++v) {
    std::memcpy(depth_row_.data(), depth.data() + static_cast<std::size_t>(v) * row_bytes,
                row_bytes);
    project(v);
    resample_columns();
    resample_rows();
    std::swap(above_, below_);
  }
  std::ranges::fill(below_.w, 0.0F);
  resample_rows();
  write(target);
  return {};
}

void DepthRegistration::project(int v) {
  const auto ray_y = static_cast<float>((v - geometry_.depth.cy) / geometry_.depth.fy);
  const Eigen::Vector3f along = R_pixel_depth_.col(0);
  const Eigen::Vector3f across = R_pixel_depth_.col(1) * ray_y + R_pixel_depth_.col(2);
  const Eigen::Vector3f origin = p_pixel_depth_;
  for (std::size_t u = 0; u < depth_row_.size(); ++u) {
    const auto z = static_cast<float>(depth_row_[u]);
    const float ray_x = ray_x_[u];
    const float w = 1 / (z * (along.z() * ray_x + across.z()) + origin.z());
    projected_.x[u] = (z * (along.x() * ray_x + across.x()) + origin.x()) * w;
    projected_.y[u] = (z * (along.y() * ray_x + across.y()) + origin.y()) * w;
    projected_.w[u] = z > 0 ? w : 0.0F;
  }
  if (geometry_.color.model != DistortionModel::kNone) {
    distort(projected_);
  }
}

/// Brown-Conrady with three radial coefficients, as in OpenCV.
void DepthRegistration::distort(Row& row) const {
  const CameraIntrinsics& color = geometry_.color;
  const auto& [k1, k2, p1, p2, k3] = color.distortion;
  for (std::size_t u = 0; u < row.x.size(); ++u) {
    const auto x = static_cast<double>(row.x[u]);
    const auto y = static_cast<double>(row.y[u]);
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double x_distorted = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    const double y_distorted = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    row.x[u] = static_cast<float>(color.fx * x_distorted + color.cx);
    row.y[u] = static_cast<float>(color.fy * y_distorted + color.cy);
  }
}

/// Puts the projected row on colour columns: below_.
void DepthRegistration::resample_columns() {
  const int width = geometry_.color.width;
  const float half = half_pitch_px_.x();
  const Row& from = projected_;
  std::ranges::fill(below_.w, 0.0F);
  const auto put = [&](int column, float y, float w) {
    const auto c = static_cast<std::size_t>(column);
    if (w > below_.w[c]) {
      below_.w[c] = w;
      below_.y[c] = y;
    }
  };
  const auto put_outline = [&](std::size_t u, float begin, float end) {
    const Span span = centres(from.x[u] + begin, from.x[u] + end, width);
    for (int c = span.first; c < span.end; ++c) {
      put(c, from.y[u], from.w[u]);
    }
  };
  bool joined = false;  // to the pixel before
  for (std::size_t u = 0; u < from.x.size(); ++u) {
    const float w0 = from.w[u];
    if (w0 <= 0) {
      joined = false;
      continue;
    }
    if (!joined) {
      put_outline(u, -half, 0);
    }
    joined = u + 1 < from.x.size() && same_surface(w0, from.w[u + 1]);
    if (!joined) {
      put_outline(u, 0, half);
      continue;
    }
    const float x0 = from.x[u];
    const float per_px = 1 / (from.x[u + 1] - x0);
    const Span span = centres(x0, from.x[u + 1], width);
    for (int c = span.first; c < span.end; ++c) {
      const float ratio = (static_cast<float>(c) - x0) * per_px;
      put(c, from.y[u] + ratio * (from.y[u + 1] - from.y[u]), w0 + ratio * (from.w[u + 1] - w0));
    }
  }
}

/// Puts the surface between above_ and below_ on colour rows.
void DepthRegistration::resample_rows() {
  const int height = geometry_.color.height;
  const auto width = static_cast<std::size_t>(geometry_.color.width);
  const float half = half_pitch_px_.y();
  for (std::size_t c = 0; c < width; ++c) {
    const float w0 = above_.w[c];
    const float w1 = below_.w[c];
    const float y0 = above_.y[c];
    const auto fill = [&](float begin, float end, float slope) {
      const Span span = centres(begin, end, height);
      for (int row = span.first; row < span.end; ++row) {
        float& kept = inverse_[static_cast<std::size_t>(row) * width + c];
        kept = std::max(kept, w0 + slope * (static_cast<float>(row) - y0));
      }
    };
    const bool was_joined = joined_[c] != 0;
    const bool joined = w0 > 0 && same_surface(w0, w1);
    joined_[c] = static_cast<char>(joined);
    if (joined) {
      fill(y0, below_.y[c], (w1 - w0) / (below_.y[c] - y0));
    } else if (w0 > 0) {
      fill(y0, y0 + half, 0);
    }
    if (w0 > 0 && !was_joined) {
      fill(y0 - half, y0, 0);
    }
  }
}

void DepthRegistration::write(std::span<std::uint16_t> target) const {
  constexpr float kLargest = 65535;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const float w = inverse_[i];
    const float z = w > 0 ? std::min(1 / w + 0.5F, kLargest) : 0.0F;
    target[i] = static_cast<std::uint16_t>(static_cast<std::int32_t>(z));
  }
}

}  // namespace geoflow::drivers::d435i
