#include "imu/still_stretch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "imu/uniform_series.hpp"

namespace geoflow::calibration {
namespace {

constexpr double kBlockS = 0.2;
constexpr std::size_t kFewestInBlock = 4;
/// Blocks over which what "still" means is averaged: ten seconds.
constexpr std::size_t kMemory = 50;
constexpr double kScatterRatio = 4;

struct Limits {
  double mean;              ///< how far a block's mean may be from those before
  double smallest_scatter;  ///< about a sensor's step: no block is quieter than that
};
constexpr Limits kAccel{.mean = 0.15, .smallest_scatter = 1e-2};
constexpr Limits kGyro{.mean = 0.015, .smallest_scatter = 2e-3};

const Limits& limits_of(std::size_t axis) {
  return axis < 3 ? kAccel : kGyro;
}

struct Block {
  std::array<double, kImuAxes> mean{};
  std::array<double, kImuAxes> scatter{};  ///< standard deviation
};

std::vector<Block> blocks_of(const UniformSeries& series, std::size_t length) {
  std::vector<Block> blocks(series.size() / length);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
      const std::vector<double>& values = series.axes.at(axis);
      double sum = 0;
      for (std::size_t i = b * length; i < (b + 1) * length; ++i) {
        sum += values[i];
      }
      const double mean = sum / static_cast<double>(length);
      double squares = 0;
      for (std::size_t i = b * length; i < (b + 1) * length; ++i) {
        squares += (values[i] - mean) * (values[i] - mean);
      }
      blocks[b].mean.at(axis) = mean;
      blocks[b].scatter.at(axis) = std::sqrt(squares / static_cast<double>(length));
    }
  }
  return blocks;
}

/// Of any block, by axis.
std::array<double, kImuAxes> quietest(const std::vector<std::vector<Block>>& pieces) {
  std::array<double, kImuAxes> least{};
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    double smallest = std::numeric_limits<double>::infinity();
    for (const std::vector<Block>& blocks : pieces) {
      for (const Block& block : blocks) {
        smallest = std::min(smallest, block.scatter.at(axis));
      }
    }
    least.at(axis) = std::max(smallest, limits_of(axis).smallest_scatter);
  }
  return least;
}

/// What "still" means for the next block: the mean of the last ones of a stretch.
class Reference {
 public:
  void restart() { count_ = 0; }
  [[nodiscard]] bool fits(const Block& block) const {
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
      if (count_ > 0 && std::abs(block.mean.at(axis) - mean_.at(axis)) > limits_of(axis).mean) {
        return false;
      }
    }
    return true;
  }
  void take(const Block& block) {
    count_ = std::min(count_ + 1, kMemory);
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
      const double before = count_ == 1 ? block.mean.at(axis) : mean_.at(axis);
      mean_.at(axis) = before + (block.mean.at(axis) - before) / static_cast<double>(count_);
    }
  }

 private:
  std::array<double, kImuAxes> mean_{};
  std::size_t count_ = 0;
};

bool quiet(const Block& block, const std::array<double, kImuAxes>& least) {
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    if (block.scatter.at(axis) > kScatterRatio * least.at(axis)) {
      return false;
    }
  }
  return true;
}

/// Blocks [begin, end).
struct Run {
  std::size_t begin = 0;
  std::size_t end = 0;
};

std::vector<Run> still_runs(const std::vector<Block>& blocks,
                            const std::array<double, kImuAxes>& least) {
  std::vector<Run> runs;
  bool open = false;  // the last run goes on
  Reference reference;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const bool is_quiet = quiet(blocks[b], least);
    open = open && is_quiet && reference.fits(blocks[b]);
    if (!open) {
      reference.restart();
    }
    if (is_quiet && !open) {
      runs.push_back({.begin = b, .end = b});
      open = true;
    }
    if (open) {
      reference.take(blocks[b]);
      runs.back().end = b + 1;
    }
  }
  return runs;
}

/// Without the blocks at its ends within which a motion may have ended or begun.
Run without_motion(Run run, std::size_t blocks) {
  if (run.begin > 0 && run.begin < run.end) {
    ++run.begin;
  }
  if (run.end < blocks && run.begin < run.end) {
    --run.end;
  }
  return run;
}

}  // namespace

std::vector<StillStretch> still_stretches(const UniformRecording& recording) {
  const auto length =
      std::max(kFewestInBlock, static_cast<std::size_t>(std::lround(kBlockS / recording.period_s)));
  std::vector<std::vector<Block>> pieces;
  pieces.reserve(recording.pieces.size());
  for (const UniformSeries& series : recording.pieces) {
    pieces.push_back(blocks_of(series, length));
  }
  const auto least = quietest(pieces);
  std::vector<StillStretch> stretches;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    for (const Run& whole : still_runs(pieces[p], least)) {
      const Run run = without_motion(whole, pieces[p].size());
      const std::size_t end =
          run.end == pieces[p].size() ? recording.pieces[p].size() : run.end * length;
      if (run.end > run.begin) {
        stretches.push_back({.piece = p, .begin = run.begin * length, .end = end});
      }
    }
  }
  return stretches;
}

StillStretch longest_still(const UniformRecording& recording) {
  const std::vector<StillStretch> all = still_stretches(recording);
  const auto longest = std::ranges::max_element(all, {}, &StillStretch::size);
  return longest == all.end() ? StillStretch{} : *longest;
}

}  // namespace geoflow::calibration
