#include "vision/patch_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include "geoflow/hal/geometry.hpp"

#include "vision/image_pyramid.hpp"

namespace geoflow::slam {
namespace {

constexpr int kSide = 2 * kPatchRadiusPx + 1;
constexpr int kWide = kSide + 2;  ///< with a rim for the derivatives

// Columns of these are rows of the image.
using Row = Eigen::Array<float, kSide, 1>;
using Patch = Eigen::Array<float, kSide, kSide>;
using WidePatch = Eigen::Array<float, kWide, kWide>;

/// A gray level between pixels. Precondition: inside by a pixel.
float bilinear(const cv::Mat& image, float x, float y) {
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const float fx = x - static_cast<float>(column);
  const float fy = y - static_cast<float>(row);
  const auto* upper = image.ptr<std::uint8_t>(row) + column;
  const auto* lower = image.ptr<std::uint8_t>(row + 1) + column;
  const auto mix = [](float a, float b, float share) { return a + share * (b - a); };
  return mix(mix(upper[0], upper[1], fx), mix(lower[0], lower[1], fx), fy);
}

/// Whether there are four pixels around, also after rounding to single precision.
bool inside(const cv::Mat& image, double x, double y) {
  constexpr double kRoundingPx = 0.01;
  return x >= kRoundingPx && y >= kRoundingPx && x < image.cols - 1 - kRoundingPx &&
         y < image.rows - 1 - kRoundingPx;
}

/// The reference as it would look in the current image, from the level of about its resolution.
std::optional<WidePatch> warped(const ImagePyramid& reference, const PatchWarp& warp) {
  const int coarsest = static_cast<int>(reference.levels().size() / 2) - 1;
  const int level = std::clamp(static_cast<int>(std::lround(std::log2(warp.scale))), 0, coarsest);
  const cv::Mat& image = reference.levels()[2 * static_cast<std::size_t>(level)];
  Matrix3d H = warp.H_reference_offset;
  H.topRows<2>() *= std::ldexp(1.0, -level);
  constexpr double kRim = kPatchRadiusPx + 1;
  for (const auto& [x, y] : {std::pair{-kRim, -kRim}, {kRim, -kRim}, {kRim, kRim}, {-kRim, kRim}}) {
    const Vector3d corner = H * Vector3d{x, y, 1};
    const Vector2d pixel = corner.hnormalized();
    if (!(corner.z() > 0) || !inside(image, pixel.x(), pixel.y())) {
      return std::nullopt;  // where its corners are inside, so is all of a convex patch
    }
  }
  using WideRow = Eigen::Array<float, kWide, 1>;
  const Eigen::Matrix3f H_pixel = H.cast<float>();
  const WideRow offsets = WideRow::LinSpaced(-kRim, kRim);
  WidePatch patch;
  for (int row = 0; row < kWide; ++row) {
    const Eigen::Vector3f left = H_pixel.rightCols<2>() * Eigen::Vector2f{offsets[row], 1};
    const WideRow inverse = (left.z() + H_pixel(2, 0) * offsets).inverse();
    const WideRow x = (left.x() + H_pixel(0, 0) * offsets) * inverse;
    const WideRow y = (left.y() + H_pixel(1, 0) * offsets) * inverse;
    for (int column = 0; column < kWide; ++column) {
      patch(column, row) = bilinear(image, x[column], y[column]);
    }
  }
  return patch;
}

std::optional<Patch> read(const cv::Mat& image, const Vector2d& middle) {
  constexpr int kRadius = kPatchRadiusPx;
  if (!inside(image, middle.x() - kRadius, middle.y() - kRadius) ||
      !inside(image, middle.x() + kRadius, middle.y() + kRadius)) {
    return std::nullopt;
  }
  const int column = static_cast<int>(middle.x()) - kRadius;
  const int row = static_cast<int>(middle.y()) - kRadius;
  const auto right = static_cast<float>(middle.x() - std::floor(middle.x()));
  const auto down = static_cast<float>(middle.y() - std::floor(middle.y()));
  // All pixels of the patch lie alike between those of the image.
  const auto between = [&](int y) -> Row {
    using Bytes = Eigen::Array<std::uint8_t, kSide + 1, 1>;
    const Eigen::Array<float, kSide + 1, 1> gray =
        Eigen::Map<const Bytes>{image.ptr<std::uint8_t>(y) + column}.cast<float>();
    return gray.head<kSide>() + right * (gray.tail<kSide>() - gray.head<kSide>());
  };
  Patch patch;
  Row upper = between(row);
  for (int i = 0; i < kSide; ++i) {
    const Row lower = between(row + i + 1);
    patch.col(i) = upper + down * (lower - upper);
    upper = lower;
  }
  return patch;
}

/// What is looked for: zero-mean gray levels of unit norm, and their derivatives by the position.
struct Template {
  Patch gray;
  Patch by_x;
  Patch by_y;
  Eigen::Matrix2d information;
};

/// A patch's gray levels less their mean, of unit norm.
struct Normalised {
  Patch gray;
  float contrast;  ///< the norm they had
};

/// Nothing where there is no more contrast than a camera's noise.
std::optional<Normalised> normalised(const Patch& patch) {
  constexpr float kLeastContrast = 2;  // standard deviation
  const Patch centred = patch - patch.mean();
  const float norm = centred.matrix().norm();
  if (!(norm > kLeastContrast * kSide)) {
    return std::nullopt;
  }
  return Normalised{.gray = centred * (1 / norm), .contrast = norm};
}

std::optional<Template> make_template(const WidePatch& wide) {
  const auto unit = normalised(wide.block<kSide, kSide>(1, 1));
  if (!unit) {
    return std::nullopt;
  }
  const float per_difference = 1 / (2 * unit->contrast);
  Template made{
      .gray = unit->gray,
      .by_x = (wide.block<kSide, kSide>(2, 1) - wide.block<kSide, kSide>(0, 1)) * per_difference,
      .by_y = (wide.block<kSide, kSide>(1, 2) - wide.block<kSide, kSide>(1, 0)) * per_difference,
      .information = {}};
  // Mean and contrast are free: what they explain of the derivatives says nothing of the position.
  for (Patch* derivative : {&made.by_x, &made.by_y}) {
    *derivative -= derivative->mean();
    *derivative -= (*derivative * made.gray).sum() * made.gray;
  }
  const auto dot = [](const Patch& a, const Patch& b) {
    return static_cast<double>((a * b).sum());
  };
  made.information << dot(made.by_x, made.by_x), dot(made.by_x, made.by_y),
      dot(made.by_x, made.by_y), dot(made.by_y, made.by_y);
  return made;
}

PatchSearch not_there() {
  return {.result = PatchSearch::Result::kNotThere};
}

}  // namespace

std::optional<PatchWarp> make_warp(const Eigen::Matrix<double, 2, 4>& corners) {
  constexpr double kRadius = kPatchRadiusPx;
  // H maps the unit square's corners so (Heckbert, "Fundamentals of texture mapping", 1989).
  const Vector2d p0 = corners.col(0);
  const Vector2d p1 = corners.col(1);
  const Vector2d p2 = corners.col(2);
  const Vector2d p3 = corners.col(3);
  Eigen::Matrix2d sides;
  sides << p1 - p2, p3 - p2;
  const Vector2d sum = p0 - p1 + p2 - p3;
  const double area = sides.determinant();
  const Vector2d gh = sides.inverse() * sum;
  Matrix3d H_reference_square;
  H_reference_square << p1 - p0 + gh.x() * p1, p3 - p0 + gh.y() * p3, p0, gh.x(), gh.y(), 1;
  Matrix3d H_square_offset;
  H_square_offset << 1 / (2 * kRadius), 0, 0.5, 0, 1 / (2 * kRadius), 0.5, 0, 0, 1;
  PatchWarp warp{.H_reference_offset = H_reference_square * H_square_offset};
  const Vector3d denominators = H_reference_square.row(2);
  const bool convex = area < 0 && 1 + denominators.x() > 0 && 1 + denominators.y() > 0 &&
                      1 + denominators.x() + denominators.y() > 0;
  Eigen::Matrix2d stretch;
  stretch << (p1 + p2 - p0 - p3) / (4 * kRadius), (p2 + p3 - p0 - p1) / (4 * kRadius);
  // Its singular values: the product is |det|, the sum of squares the squared Frobenius norm.
  const double product = std::abs(stretch.determinant());
  const double sum2 = stretch.squaredNorm() + 2 * product;
  const double difference2 = std::max(0.0, stretch.squaredNorm() - 2 * product);
  if (!convex || !warp.H_reference_offset.allFinite() || !(product > 0)) {
    return std::nullopt;
  }
  warp.scale = std::sqrt(product);
  const double larger = 0.5 * (std::sqrt(sum2) + std::sqrt(difference2));
  warp.anisotropy = larger * larger / product;
  return warp;
}

PatchSearch align_patch(const ImagePyramid& reference, const PatchWarp& warp,
                        const ImagePyramid& current, const Vector2d& start) {
  constexpr int kIterations = 20;
  constexpr double kConvergedPx = 0.02;
  constexpr double kStrayPx = 2;
  constexpr double kAlike = 0.5;  // correlation: less is another patch
  constexpr double kCertainPx = 0.3;
  constexpr double kLeastInformation =
      0.01;  // of the weaker direction [1/px^2]: 0.1 of all contrast a pixel
  const auto wide = warped(reference, warp);
  if (!wide) {
    return {};
  }
  const auto wanted = make_template(*wide);
  if (!wanted) {
    return not_there();
  }
  const Template& sought = *wanted;
  const double half_trace = 0.5 * sought.information.trace();
  const double weaker =
      half_trace -
      std::sqrt(std::max(0.0, half_trace * half_trace - sought.information.determinant()));
  if (weaker < kLeastInformation) {
    return not_there();
  }
  const Eigen::Matrix2d covariance = sought.information.inverse();
  Vector2d pixel = start;
  for (int i = 0; i < kIterations; ++i) {
    const auto patch = read(current.image(), pixel);
    const auto seen = patch ? normalised(*patch) : std::nullopt;
    if (!seen) {
      return not_there();
    }
    const Patch difference = seen->gray - sought.gray;
    const Vector2d gradient{static_cast<double>((sought.by_x * difference).sum()),
                            static_cast<double>((sought.by_y * difference).sum())};
    const Vector2d step = covariance * gradient;
    pixel -= step;
    if (!((pixel - start).norm() < kStrayPx)) {
      return not_there();
    }
    if (step.norm() < kConvergedPx) {
      const double correlation = static_cast<double>((seen->gray * sought.gray).sum());
      // A camera's noise and blur cost correlation but not the place: what counts is how well the
      // differences that are left let it be told (two unit patches differ by 2 - 2 correlation).
      const double variance_px2 = 2 * (1 - correlation) / (kSide * kSide) / weaker;
      return correlation > kAlike && variance_px2 < kCertainPx * kCertainPx
                 ? PatchSearch{.result = PatchSearch::Result::kFound, .pixel = pixel}
                 : not_there();
    }
  }
  return not_there();
}

}  // namespace geoflow::slam
