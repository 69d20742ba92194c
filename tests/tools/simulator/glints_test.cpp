#include "src/glints.hpp"

#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/tools/simulator/lanes.hpp"

namespace geoflow::simulator::tests {
namespace {

constexpr int kWidth = 50;  // no multiple of the lanes
constexpr int kHeight = 60;
constexpr float kFocal_px = 600;
constexpr float kShare = 0.1F;
constexpr float kSpark_nit = 500;

std::size_t index(int x, int y) {
  return static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x);
}

/// A mirror of `roughness` below row 20 in which one pixel's ray met a lamp, all others nothing.
Glints one_spark(float roughness) {
  Glints glints{kWidth, kHeight};
  for (int y = 20; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      glints.light[index(x, y)] = Rgb{0, 0, 0, kShare};
      glints.rough[index(x, y)] = roughness * kShare;
    }
  }
  glints.light[index(30, 40)] = Rgb{kSpark_nit, kSpark_nit, kSpark_nit, kShare};
  return glints;
}

std::vector<Rgb> added(const Glints& glints) {
  std::vector<Rgb> image(glints.light.size());
  add_glints(glints, kFocal_px, image);
  return image;
}

TEST(Glints, OnARoughMirrorSpreadOverTheirNeighboursAndLoseNothing) {
  constexpr float kRoughness = 0.01F;  // 3 px upwards and downwards
  const std::vector<Rgb> image = added(one_spark(kRoughness));
  float sum_nit = 0;
  for (const Rgb& pixel : image) {
    sum_nit += pixel[1];
  }
  EXPECT_NEAR(sum_nit, kSpark_nit, 1e-3F * kSpark_nit);
  EXPECT_NEAR(image[index(30, 40)][1], 0.375F * kSpark_nit / 7, 1e-3F * kSpark_nit);
  EXPECT_NEAR(image[index(30, 43)][1], image[index(30, 40)][1], 1e-3F * kSpark_nit);
  EXPECT_NEAR(image[index(30, 44)][1], 0, 1e-3F * kSpark_nit);
}

TEST(Glints, OnASmoothMirrorStayWhereTheyAre) {
  const std::vector<Rgb> image = added(one_spark(0));
  EXPECT_EQ(image[index(30, 40)][1], kSpark_nit);
  EXPECT_EQ(image[index(30, 41)][1], 0);
}

TEST(Glints, DoNotLeaveTheMirror) {
  Glints glints = one_spark(0.02F);
  glints.light[index(30, 20)] = glints.light[index(30, 40)];
  const std::vector<Rgb> image = added(glints);
  EXPECT_GT(image[index(30, 20)][1], 0);
  EXPECT_EQ(image[index(30, 19)][1], 0);
}

}  // namespace
}  // namespace geoflow::simulator::tests
