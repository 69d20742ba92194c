#include "src/stereo.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"

#include "src/infrared_view.hpp"
#include "src/smooth_noise.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kFaintSignal = 0.06F;   // where disparity's deviation is sqrt(2) of the best
constexpr float kLeastSignal = 0.008F;  // where half of the pixels have no measurement
constexpr float kPitchX_px = 8.0F;
constexpr float kPitchY_px = 6.0F;
constexpr float kRaggedPitch_px = 5.0F;
constexpr float kRagged_px = 1.3F;    // how far an edge is seen beside its place
constexpr float kStep_px = 1.0F;      // a jump of disparity that is an edge
constexpr float kWhiteShare = 0.05F;  // of the variance that is not correlated
constexpr float kSubpixelSteps = 32.0F;
constexpr float kHoleSpread = 0.5F;  // of log signal about the least

/// True disparity of all pixels [px]; 0 for the sky.
std::vector<float> true_disparity(const InfraredView& seen, float focal_baseline) {
  std::vector<float> disparity(seen.depth_m.size());
  for (std::size_t i = 0; i < disparity.size(); ++i) {
    disparity[i] = seen.depth_m[i] > 0 ? focal_baseline / seen.depth_m[i] : 0.0F;
  }
  return disparity;
}

/// One row's worth of what is random.
struct RandomRow {
  std::vector<float> noise;
  std::vector<float> holes;
  std::vector<float> aside;
  std::vector<float> above;
};

/// Matches row by row; const and thread-safe.
class Matcher {
 public:
  Matcher(const InfraredView& seen, const CameraIntrinsics& intrinsics,
          const CameraOptions& options, std::uint64_t key)
      : seen_{&seen},
        options_{&options},
        key_{key},
        width_{intrinsics.width},
        height_{intrinsics.height},
        focal_baseline_{static_cast<float>(intrinsics.fx * kD435iBaseline_m)},
        disparity_{true_disparity(seen, focal_baseline_)},
        noise_{subkey(key, "disparity"), width_, kPitchX_px, kPitchY_px},
        holes_{subkey(key, "holes"), width_, kPitchX_px, kPitchY_px},
        aside_{subkey(key, "aside"), width_, kRaggedPitch_px, kRaggedPitch_px},
        above_{subkey(key, "above"), width_, kRaggedPitch_px, kRaggedPitch_px} {}

  void row(int y, std::vector<float>& depth_m) const {
    RandomRow random;
    noise_.row(y, random.noise);
    holes_.row(y, random.holes);
    aside_.row(y, random.aside);
    above_.row(y, random.above);
    // Seen from the right camera a point lies at x - d. Whatever lies right of it in the left image
    // and left of it in the right one is nearer, and hides it.
    float leftmost = std::numeric_limits<float>::infinity();
    for (int x = width_ - 1; x >= 0; --x) {
      const std::size_t i = index(x, y);
      const float disparity = disparity_[i];
      const float right_x = static_cast<float>(x) - disparity;
      const bool hidden = right_x > leftmost + 1.0F || right_x < 0.0F;
      leftmost = std::min(leftmost, right_x);
      if (options_->depth_errors && (hidden || disparity == 0.0F)) {
        continue;
      }
      depth_m[i] = measure(x, y, random);
    }
  }

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  [[nodiscard]] float disparity_at(int x, int y) const {
    return disparity_[index(std::clamp(x, 0, width_ - 1), std::clamp(y, 0, height_ - 1))];
  }

  [[nodiscard]] float measure(int x, int y, const RandomRow& random) const {
    const std::size_t i = index(x, y);
    const std::uint64_t bits = subkey(key_, i);
    const auto column = static_cast<std::size_t>(x);
    float disparity = disparity_[i];
    if (options_->depth_errors) {
      disparity = beside_edges(x, y, random, bits);
      if (lost(seen_->signal[i], random.holes[column])) {
        return 0;
      }
    }
    if (disparity <= 0) {
      return 0;
    }
    const float correlated = std::sqrt(1.0F - kWhiteShare) * random.noise[column];
    const float white = std::sqrt(kWhiteShare) * to_normal(scramble(bits));
    const auto scale = static_cast<float>(options_->depth_noise_scale);
    disparity += scale * static_cast<float>(options_->depth_subpixel_px) *
                 disparity_spread(seen_->signal[i]) * (correlated + white);
    if (scale > 0) {
      disparity =
          static_cast<float>(whole_below(kSubpixelSteps * disparity + 0.5F)) / kSubpixelSteps;
    }
    const float depth = disparity > 0 ? focal_baseline_ / disparity : 0.0F;
    const bool in_range = depth >= static_cast<float>(options_->depth_min_m) &&
                          depth <= static_cast<float>(options_->depth_max_m);
    return in_range ? depth : 0.0F;
  }

  [[nodiscard]] static bool lost(float signal, float field) {
    // Most pixels are far from it: a field of 6 deviations holes nothing above e^3 times the least.
    constexpr float kWide = 6.0F;
    constexpr float kClear = 20.1F;
    if (signal > kClear * kLeastSignal && field < kWide) {
      return false;
    }
    return std::log(std::max(signal, std::numeric_limits<float>::min()) / kLeastSignal) <
           kHoleSpread * field;
  }

  /// The disparity that a window finds: beside a step it may be the neighbour's, something between,
  /// or nothing (0).
  [[nodiscard]] float beside_edges(int x, int y, const RandomRow& random,
                                   std::uint64_t bits) const {
    constexpr float kNothing = 0.35F;
    constexpr float kBetween = 0.5F;
    const auto column = static_cast<std::size_t>(x);
    const int seen_x = x + whole_below(kRagged_px * random.aside[column] + 0.5F);
    const int seen_y = y + whole_below(kRagged_px * random.above[column] + 0.5F);
    const float disparity = disparity_at(seen_x, seen_y);
    float nearest = disparity;
    float farthest = disparity;
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
      const float other = disparity_at(seen_x + dx, seen_y + dy);
      nearest = std::max(nearest, other);
      farthest = std::min(farthest, other);
    }
    // A slanted surface has a slope, a step is more than both its sides' slopes.
    if (nearest - farthest < kStep_px || nearest + farthest - 2.0F * disparity == 0.0F) {
      return disparity;
    }
    const float chance = to_unit(bits);
    if (chance < kNothing) {
      return 0;
    }
    return chance < kBetween ? farthest + (nearest - farthest) * to_unit(scramble(bits + 1))
                             : disparity;
  }

  const InfraredView* seen_;
  const CameraOptions* options_;
  std::uint64_t key_;
  int width_;
  int height_;
  float focal_baseline_;
  std::vector<float> disparity_;
  SmoothNoise noise_;
  SmoothNoise holes_;
  SmoothNoise aside_;
  SmoothNoise above_;
};

}  // namespace

float disparity_spread(float signal) noexcept {
  constexpr float kFaintest = 1e-3F;
  const float ratio = kFaintSignal / std::max(signal, kFaintest);
  return std::sqrt(1.0F + ratio * ratio);
}

std::vector<float> match_stereo(const InfraredView& seen, const CameraIntrinsics& intrinsics,
                                const CameraOptions& options, std::uint64_t key) {
  const Matcher matcher{seen, intrinsics, options, key};
  std::vector<float> depth_m(seen.depth_m.size());
  tbb::parallel_for(0, intrinsics.height, [&](int y) { matcher.row(y, depth_m); });
  return depth_m;
}

}  // namespace geoflow::simulator
