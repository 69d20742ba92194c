#include "vision/patch_alignment.hpp"

#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "geoflow/hal/geometry.hpp"

#include "vision/image_pyramid.hpp"

namespace geoflow::slam {
namespace {

using Corners = Eigen::Matrix<double, 2, 4>;

/// Smooth waves, so that a shift by a part of a pixel is exactly known.
double wave(double x, double y) {
  constexpr double kMean = 120;
  constexpr double kAmplitude = 35;
  return kMean + kAmplitude * (std::sin(0.55 * x + 0.1 * y) + std::cos(0.47 * y - 0.21 * x));
}

template <typename Gray>
ImagePyramid image_of(const Gray& gray) {
  cv::Mat1b image(96, 128);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image(y, x) = static_cast<std::uint8_t>(std::lround(gray(x, y)));
    }
  }
  return {image, 21, 2};
}

Corners square(const Vector2d& middle, double radius) {
  Corners corners;
  corners << -1, 1, 1, -1, -1, -1, 1, 1;
  return (radius * corners).colwise() + middle;
}

TEST(PatchWarp, TakesTheCornersToTheirPlaces) {
  Corners corners;
  corners << 40, 58, 60, 38, 30, 31, 50, 47;
  const auto warp = make_warp(corners);
  ASSERT_TRUE(warp);
  const Corners offsets = square({0, 0}, kPatchRadiusPx);
  for (int i = 0; i < 4; ++i) {
    const Vector2d corner = (warp->H_reference_offset * offsets.col(i).homogeneous()).hnormalized();
    EXPECT_NEAR((corner - corners.col(i)).norm(), 0, 1e-9);
  }
}

TEST(PatchWarp, SaysHowMuchItStretches) {
  Corners corners = square({50, 40}, kPatchRadiusPx);
  corners.row(0) *= 3;
  const auto warp = make_warp(corners);
  ASSERT_TRUE(warp);
  EXPECT_NEAR(warp->scale, std::sqrt(3), 1e-9);
  EXPECT_NEAR(warp->anisotropy, 3, 1e-9);
}

TEST(PatchWarp, RefusesWhatIsNoView) {
  const Corners corners = square({50, 40}, kPatchRadiusPx);
  Corners mirrored = corners;
  mirrored.row(0).reverseInPlace();
  mirrored.row(1).reverseInPlace();
  EXPECT_FALSE(make_warp(mirrored));
  Corners folded = corners;
  folded.col(2) = Vector2d{40, 30};
  EXPECT_FALSE(make_warp(folded));
  EXPECT_FALSE(make_warp(Corners::Constant(5)));
  EXPECT_FALSE(make_warp(Corners::Constant(std::nan(""))));
}

TEST(PatchAlignment, FindsAShiftWhateverTheExposure) {
  const ImagePyramid reference = image_of(wave);
  const ImagePyramid current =
      image_of([](double x, double y) { return 20 + 0.7 * wave(x - 0.37, y + 0.62); });
  const auto warp = make_warp(square({60, 44}, kPatchRadiusPx));
  const auto found = align_patch(reference, *warp, current, Vector2d{59.4, 44.3});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->x(), 60.37, 0.02);
  EXPECT_NEAR(found->y(), 43.38, 0.02);
}

TEST(PatchAlignment, FindsWhatIsSeenFromHalfTheDistance) {
  const ImagePyramid reference = image_of(wave);
  const ImagePyramid current =
      image_of([](double x, double y) { return wave(40 + 0.5 * (x - 64), 50 + 0.5 * (y - 48)); });
  const auto warp = make_warp(square({40, 50}, 0.5 * kPatchRadiusPx));
  const auto found = align_patch(reference, *warp, current, Vector2d{65, 47});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->x(), 64, 0.03);
  EXPECT_NEAR(found->y(), 48, 0.03);
}

TEST(PatchAlignment, RefusesWhatDoesNotDetermineIt) {
  const ImagePyramid reference = image_of(wave);
  const auto warp = make_warp(square({60, 44}, kPatchRadiusPx));
  const Vector2d start{60, 44};
  EXPECT_FALSE(align_patch(reference, *warp, image_of([](double, double) { return 100; }), start));
  EXPECT_FALSE(align_patch(reference, *warp,
                           image_of([](double x, double y) { return wave(y, x); }), start));
  EXPECT_FALSE(align_patch(reference, *warp, reference, Vector2d{4, 44}));
  EXPECT_FALSE(align_patch(reference, *warp, reference, Vector2d{60, 49}));
  const ImagePyramid stripes =
      image_of([](double x, double) { return 120 + 50 * std::sin(0.5 * x); });
  EXPECT_FALSE(align_patch(stripes, *warp, stripes, start));
  const auto outside = make_warp(square({3, 44}, kPatchRadiusPx));
  EXPECT_FALSE(align_patch(reference, *outside, reference, start));
}

}  // namespace
}  // namespace geoflow::slam
