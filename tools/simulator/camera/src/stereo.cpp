#include "src/stereo.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
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

constexpr float kFaintSignal = 0.06F;    // where disparity's deviation is sqrt(2) of the best
constexpr float kLeastSignal = 0.0045F;  // where half of the pixels have no measurement
constexpr float kWindowX_px = 11.0F;     // where neighbours' errors are alike by a half
constexpr float kWindowY_px = 7.0F;
constexpr float kRipple_px = 0.012F;
constexpr float kCalibratedWidth_px = 640.0F;  // an angle's error is fewer of coarser pixels
constexpr float kCalibrationPitch = 0.25F;     // of the image's width
constexpr float kRaggedPitch_px = 5.0F;
constexpr float kRagged_px = 1.3F;  // how far an edge is seen beside its place
constexpr float kStep_px = 1.0F;    // a jump of disparity that is an edge
constexpr float kNever_px = std::numeric_limits<float>::infinity();
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

[[gnu::always_inline]] inline float spread_of(float signal) noexcept {
  constexpr float kFaintest = 1e-3F;
  const float ratio = kFaintSignal / std::max(signal, kFaintest);
  return std::sqrt(1.0F + ratio * ratio);
}

/// What a window that finds `disparity` adds to it, between whole pixels: a sine's likeness of two
/// parabolas, above whole numbers upwards.
[[gnu::always_inline]] inline float ripple_of(float disparity) noexcept {
  constexpr float kSteepness = 8.0F;
  const float beyond_half = disparity - static_cast<float>(whole_below(disparity)) - 0.5F;
  return -kSteepness * kRipple_px * beyond_half * (1.0F - 2.0F * std::abs(beyond_half));
}

/// 0 where `value` is beyond either bound. One choice after the other: GCC makes no vectors of a
/// choice between truths.
[[gnu::always_inline]] inline float zero_beyond(float value, float low, float high) noexcept {
  const float not_above = value <= high ? value : 0.0F;
  return value >= low ? not_above : 0.0F;
}

/// One row's worth of what is random.
struct RandomRow {
  std::vector<float> noise;
  std::vector<float> calibration;
  std::vector<float> holes;
  std::vector<float> aside;
  std::vector<float> above;
};

/// Some pixels of a row, and what is random of them.
struct Stretch {
  int x = 0;  ///< of the first
  int y = 0;
  int count = 0;
  Lanes signal{};
  Lanes noise{};
  Lanes calibration{};
  Lanes aside{};
  Lanes above{};
  Lanes chance{};
  Lanes between{};
};

void take(const std::vector<float>& row, std::size_t first, std::size_t count, Lanes& lanes) {
  std::copy_n(row.begin() + static_cast<std::ptrdiff_t>(first), count, lanes.begin());
}

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
        noise_{subkey(key, "disparity"), width_, height_, kWindowX_px, kWindowY_px},
        calibration_{subkey(options.seed, "stereo calibration"), width_, height_,
                     kCalibrationPitch * static_cast<float>(width_),
                     kCalibrationPitch * static_cast<float>(width_)},
        holes_{subkey(key, "holes"), width_, height_, kWindowX_px, kWindowY_px},
        aside_{subkey(key, "aside"), width_, height_, kRaggedPitch_px, kRaggedPitch_px},
        above_{subkey(key, "above"), width_, height_, kRaggedPitch_px, kRaggedPitch_px} {}

  void row(int y, std::vector<float>& depth_m) const {
    RandomRow random;
    noise_.row(y, random.noise);
    calibration_.row(y, random.calibration);
    holes_.row(y, random.holes);
    aside_.row(y, random.aside);
    above_.row(y, random.above);
    const std::size_t begin = index(0, y);
    for (int x = 0; x < width_; x += static_cast<int>(kLanes)) {
      const Stretch stretch = draw(x, y, random);
      const Lanes measured_m = measure(stretch);
      take_over(measured_m, stretch, depth_m);
    }
    if (options_->depth_errors) {
      drop_unseen(y, random.holes, std::span{depth_m}.subspan(begin, random.holes.size()));
    }
  }

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  [[nodiscard]] Stretch draw(int x, int y, const RandomRow& random) const {
    Stretch stretch{.x = x, .y = y, .count = std::min(static_cast<int>(kLanes), width_ - x)};
    const auto count = static_cast<std::size_t>(stretch.count);
    const auto column = static_cast<std::size_t>(x);
    take(seen_->signal, index(x, y), count, stretch.signal);
    take(random.noise, column, count, stretch.noise);
    take(random.calibration, column, count, stretch.calibration);
    take(random.aside, column, count, stretch.aside);
    take(random.above, column, count, stretch.above);
    with_wide_vectors([&]() __attribute__((always_inline)) {
      const std::uint64_t key = key_;
      const std::uint64_t first = index(x, y);
      for (std::size_t i = 0; i < kLanes; ++i) {
        const std::uint64_t bits = subkey(key, first + i);
        stretch.chance[i] = to_unit(bits);
        stretch.between[i] = to_unit(scramble(bits + 1));
      }
    });
    return stretch;
  }

  /// Depth [m] of what windows about the pixels find; 0: none, or out of range.
  [[nodiscard]] Lanes measure(const Stretch& stretch) const {
    Lanes depth_m;
    with_wide_vectors([&]() __attribute__((always_inline)) {
      // Copies: GCC makes no vectors of what it loads through a constant reference in here.
      const Stretch own = stretch;
      const Lanes found = beside_edges(own, options_->depth_errors ? kRagged_px : 0.0F,
                                       options_->depth_errors ? kStep_px : kNever_px);
      const auto scale = static_cast<float>(options_->depth_noise_scale);
      const float spread = scale * static_cast<float>(options_->depth_subpixel_px);
      const float calibration = scale * static_cast<float>(options_->depth_calibration_px) *
                                static_cast<float>(width_) / kCalibratedWidth_px;
      const bool rounds = scale > 0;
      const auto nearest_m = static_cast<float>(options_->depth_min_m);
      const auto farthest_m = static_cast<float>(options_->depth_max_m);
      const float focal_baseline = focal_baseline_;
      for (std::size_t i = 0; i < kLanes; ++i) {
        const float matched = found[i] + spread * spread_of(own.signal[i]) * own.noise[i] +
                              calibration * own.calibration[i];
        const float noisy = matched + scale * ripple_of(matched);
        const float stepped =
            static_cast<float>(whole_below(kSubpixelSteps * noisy + 0.5F)) / kSubpixelSteps;
        const float disparity = rounds ? stepped : noisy;
        const float depth = focal_baseline / disparity;
        const float within = zero_beyond(depth, nearest_m, farthest_m);
        const float positive = disparity > 0.0F ? within : 0.0F;
        depth_m[i] = found[i] > 0.0F ? positive : 0.0F;
      }
    });
    return depth_m;
  }

  /// The disparities that windows find: beside a step it may be the neighbour's, something between,
  /// or nothing (0). An edge is ragged by `ragged_px`; a step is one of disparity by `step_px`.
  [[nodiscard, gnu::always_inline]] Lanes beside_edges(const Stretch& stretch, float ragged_px,
                                                       float step_px) const {
    constexpr float kNothing = 0.35F;
    constexpr float kBetween = 0.5F;
    const float* const disparities = disparity_.data();
    const int width = width_;
    const int last_x = width_ - 1;
    const int last_y = height_ - 1;
    Lanes found;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const int x =
          stretch.x + static_cast<int>(i) + whole_below(ragged_px * stretch.aside[i] + 0.5F);
      const int y = stretch.y + whole_below(ragged_px * stretch.above[i] + 0.5F);
      const auto disparity_at = [&](int column, int row) __attribute__((always_inline)) {
        return disparities[std::min(std::max(row, 0), last_y) * width +
                           std::min(std::max(column, 0), last_x)];
      };
      const float here = disparity_at(x, y);
      const float left = disparity_at(x - 1, y);
      const float right = disparity_at(x + 1, y);
      const float over = disparity_at(x, y - 1);
      const float under = disparity_at(x, y + 1);
      const float nearer_aside = std::max(left, right);
      const float nearer_above = std::max(over, under);
      const float nearer = std::max(nearer_aside, nearer_above);
      const float nearest = std::max(here, nearer);
      const float farther_aside = std::min(left, right);
      const float farther_above = std::min(over, under);
      const float farther = std::min(farther_aside, farther_above);
      const float farthest = std::min(here, farther);
      // Only an edge is ragged: a slanted surface is seen where it is.
      const float own = disparity_at(stretch.x + static_cast<int>(i), stretch.y);
      const float shifted = std::abs(here - own) >= step_px ? here : own;
      const float between = farthest + (nearest - farthest) * stretch.between[i];
      const float beside = stretch.chance[i] < kBetween ? between : here;
      const float torn = stretch.chance[i] < kNothing ? 0.0F : beside;
      // A slanted surface has a slope, a step is more than both its sides' slopes. One choice after
      // the other: GCC makes no vectors of a choice between truths.
      const float steep = nearest - farthest >= step_px ? torn : shifted;
      found[i] = nearest + farthest - 2.0F * here != 0.0F ? steep : shifted;
    }
    return found;
  }

  void take_over(const Lanes& measured_m, const Stretch& stretch,
                 std::vector<float>& depth_m) const {
    const auto begin = static_cast<std::ptrdiff_t>(index(stretch.x, stretch.y));
    std::copy_n(measured_m.begin(), stretch.count, depth_m.begin() + begin);
  }

  /// Takes out of a row what only one camera sees, and what is too faint.
  void drop_unseen(int y, const std::vector<float>& holes, std::span<float> depth_m) const {
    const std::size_t begin = index(0, y);
    // Seen from the right camera a point lies at x - d. Whatever lies right of it in the left image
    // and left of it in the right one is nearer, and hides it.
    float leftmost = std::numeric_limits<float>::infinity();
    for (std::size_t x = depth_m.size(); x-- > 0;) {
      const float disparity = disparity_[begin + x];
      const float right_x = static_cast<float>(x) - disparity;
      const bool hidden = right_x > leftmost + 1.0F || right_x < 0.0F;
      leftmost = std::min(leftmost, right_x);
      if (hidden || disparity == 0.0F || lost(seen_->signal[begin + x], holes[x])) {
        depth_m[x] = 0.0F;
      }
    }
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

  const InfraredView* seen_;
  const CameraOptions* options_;
  std::uint64_t key_;
  int width_;
  int height_;
  float focal_baseline_;
  std::vector<float> disparity_;
  SmoothNoise noise_;
  SmoothNoise calibration_;
  SmoothNoise holes_;
  SmoothNoise aside_;
  SmoothNoise above_;
};

}  // namespace

std::vector<float> match_stereo(const InfraredView& seen, const CameraIntrinsics& intrinsics,
                                const CameraOptions& options, std::uint64_t key) {
  const Matcher matcher{seen, intrinsics, options, key};
  std::vector<float> depth_m(seen.depth_m.size());
  tbb::parallel_for(0, intrinsics.height, [&](int y) { matcher.row(y, depth_m); });
  return depth_m;
}

}  // namespace geoflow::simulator
