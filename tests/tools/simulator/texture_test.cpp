#include "geoflow/tools/simulator/texture.hpp"

#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"

namespace geoflow::simulator {
namespace {

/// Stripes of `period` pixels along u, 0.2 and 0.8.
std::vector<Rgb> stripes(int side, int period) {
  std::vector<Rgb> pixels;
  for (int i = 0; i < side * side; ++i) {
    const float value = (i % side) % period < period / 2 ? 0.2F : 0.8F;
    pixels.push_back(Rgb{value, value, value, 0});
  }
  return pixels;
}

/// The reflectance's red at one point, blended between the two levels around the footprint.
float sample(const Texture& texture, float u_m, float v_m, float footprint_m) {
  constexpr int kDithers = 64;
  Texture::Spots spots;
  spots.u_m.fill(u_m);
  spots.v_m.fill(v_m);
  spots.footprint_m.fill(footprint_m);
  float sum = 0;
  for (int i = 0; i < kDithers; ++i) {
    LaneColours colours;
    texture.sample(spots, (static_cast<float>(i) + 0.5F) / kDithers, colours);
    sum += colours[0][0];
    EXPECT_EQ(colours[0][0], colours[kLanes - 1][0]);
  }
  return sum / kDithers;
}

TEST(Texture, SamplesItsPixelsWhenSeenFromNear) {
  const Texture texture{stripes(64, 8), 64, 0.64F, Repeat::kTile};
  EXPECT_NEAR(sample(texture, 0.02F, 0.3F, 0.001F), 0.2F, 0.01F);
  EXPECT_NEAR(sample(texture, 0.06F, 0.3F, 0.001F), 0.8F, 0.01F);
  EXPECT_NEAR(sample(texture, 0.06F + 0.64F, 0.3F - 0.64F, 0.001F), 0.8F, 0.01F) << "it tiles";
}

TEST(Texture, TendsToItsMeanWhenSeenFromFarWithoutAliasing) {
  const Texture texture{stripes(64, 8), 64, 0.64F, Repeat::kTile};
  for (float u = 0; u < 1.0F; u += 0.013F) {
    EXPECT_NEAR(sample(texture, u, 0.1F, 0.16F), 0.5F, 0.01F) << u;
  }
}

TEST(Texture, IsContinuousInTheFootprint) {
  const Texture texture{stripes(64, 16), 64, 0.64F, Repeat::kTile};
  float before = sample(texture, 0.033F, 0.1F, 0.004F);
  for (float footprint = 0.004F; footprint < 0.3F; footprint *= 1.01F) {
    const float now = sample(texture, 0.033F, 0.1F, footprint);
    EXPECT_LT(std::abs(now - before), 0.02F) << footprint;
    before = now;
  }
}

TEST(Texture, TellsTheContrastThatAWindowSees) {
  const Texture texture{stripes(64, 8), 64, 0.64F, Repeat::kTile};
  EXPECT_NEAR(texture.contrast(0.01F), 0.6F, 0.05F);  // deviation 0.3 of mean 0.5
  EXPECT_NEAR(texture.contrast(0.3F), 0.0F, 0.02F);
}

TEST(Texture, ShuffledCopiesDiffer) {
  const std::vector<Rgb> pixels = stripes(64, 64);
  const Texture texture{pixels, 64, 1.0F, Repeat::kShuffle};
  int bright = 0;
  for (int copy = 0; copy < 100; ++copy) {
    bright += sample(texture, static_cast<float>(copy) + 0.25F, 0.5F, 0.001F) > 0.5F ? 1 : 0;
  }
  EXPECT_GT(bright, 10);
  EXPECT_LT(bright, 90);
}

TEST(Random, NormalsHaveMeanZeroAndVarianceOne) {
  Random random{5, "normals"};
  constexpr int kCount = 100'000;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < kCount; ++i) {
    const auto value = static_cast<double>(random.normal());
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 4.0 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount, 1.0, 0.02);
}

TEST(Random, NormalsOf32BitsHaveMeanZeroAndVarianceOneAndDoNotDependOnTheirNeighbours) {
  constexpr std::uint32_t kCount = 100'000;
  double sum = 0;
  double squares = 0;
  double neighbours = 0;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const auto value = static_cast<double>(to_normal32(scramble32(i)));
    sum += value;
    squares += value * value;
    neighbours += value * static_cast<double>(to_normal32(scramble32(i + 1)));
  }
  EXPECT_NEAR(sum / kCount, 0.0, 4.0 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount, 1.0, 0.02);
  EXPECT_NEAR(neighbours / kCount, 0.0, 4.0 / std::sqrt(kCount));
}

TEST(Random, AForkDependsOnItsPurposeAndNotOnWhatWasDrawn) {
  Random drawn{5, "scene"};
  const Random fresh{5, "scene"};
  static_cast<void>(drawn.bits());
  EXPECT_EQ(drawn.fork("wall").bits(), fresh.fork("wall").bits());
  EXPECT_NE(fresh.fork("wall").bits(), fresh.fork("floor").bits());
}

}  // namespace
}  // namespace geoflow::simulator
