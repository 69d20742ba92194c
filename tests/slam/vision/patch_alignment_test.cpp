#include "vision/patch_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

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
  ASSERT_TRUE(found.found());
  EXPECT_NEAR(found.pixel.x(), 60.37, 0.02);
  EXPECT_NEAR(found.pixel.y(), 43.38, 0.02);
}

TEST(PatchAlignment, FindsWhatIsSeenFromHalfTheDistance) {
  const ImagePyramid reference = image_of(wave);
  const ImagePyramid current =
      image_of([](double x, double y) { return wave(40 + 0.5 * (x - 64), 50 + 0.5 * (y - 48)); });
  const auto warp = make_warp(square({40, 50}, 0.5 * kPatchRadiusPx));
  const auto found = align_patch(reference, *warp, current, Vector2d{65, 47});
  ASSERT_TRUE(found.found());
  EXPECT_NEAR(found.pixel.x(), 64, 0.03);
  EXPECT_NEAR(found.pixel.y(), 48, 0.03);
}

/// A dim scene's noise takes two patches' correlation to two thirds. Flow alone, which is then all
/// that is left, loses the way bit by bit.
TEST(PatchAlignment, FindsItsPlaceThroughNoiseWithoutBias) {
  std::mt19937 random{3};  // NOLINT(cert-msc51-cpp): the same every time
  std::normal_distribution<double> noise{0, 25};
  std::uniform_real_distribution<double> share{-1, 1};
  const auto noisy = [&](double gray) { return std::clamp(gray + noise(random), 0.0, 255.0); };
  const auto warp = make_warp(square({60, 44}, kPatchRadiusPx));
  constexpr int kImages = 200;
  int found = 0;
  Vector2d sum = Vector2d::Zero();
  double squares = 0;
  for (int i = 0; i < kImages; ++i) {
    // Shifts of all parts of a pixel: where noise is interpolated the most, patches look most
    // alike.
    const Vector2d shift{share(random), share(random)};
    const ImagePyramid reference = image_of([&](double x, double y) { return noisy(wave(x, y)); });
    const ImagePyramid current =
        image_of([&](double x, double y) { return noisy(wave(x - shift.x(), y - shift.y())); });
    const PatchSearch search = align_patch(reference, *warp, current, Vector2d{60, 44});
    if (search.found()) {
      const Vector2d error = search.pixel - (Vector2d{60, 44} + shift);
      ++found;
      sum += error;
      squares += error.squaredNorm();
    }
  }
  EXPECT_GT(found, kImages * 9 / 10);
  EXPECT_LT((sum / found).norm(), 0.1);               // three deviations of a mean of so many
  EXPECT_LT(std::sqrt(squares / (2 * found)), 0.35);  // of each direction
}

TEST(PatchAlignment, RefusesWhatDoesNotDetermineIt) {
  constexpr auto kNotThere = PatchSearch::Result::kNotThere;
  const ImagePyramid reference = image_of(wave);
  const auto warp = make_warp(square({60, 44}, kPatchRadiusPx));
  const Vector2d start{60, 44};
  const auto look = [&](const ImagePyramid& in, const PatchWarp& as, const ImagePyramid& current,
                        const Vector2d& from) { return align_patch(in, as, current, from).result; };
  EXPECT_EQ(look(reference, *warp, image_of([](double, double) { return 100; }), start), kNotThere);
  EXPECT_EQ(look(reference, *warp, image_of([](double x, double y) { return wave(y, x); }), start),
            kNotThere);
  EXPECT_EQ(look(reference, *warp, reference, Vector2d{4, 44}), kNotThere);
  EXPECT_EQ(look(reference, *warp, reference, Vector2d{60, 49}), kNotThere);
  const ImagePyramid stripes =
      image_of([](double x, double) { return 120 + 50 * std::sin(0.5 * x); });
  EXPECT_EQ(look(stripes, *warp, stripes, start), kNotThere);
  const auto outside = make_warp(square({3, 44}, kPatchRadiusPx));
  EXPECT_EQ(look(reference, *outside, reference, start), PatchSearch::Result::kUnknown);
}

}  // namespace
}  // namespace geoflow::slam
