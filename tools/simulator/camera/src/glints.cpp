#include "src/glints.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include <tbb/parallel_for.h>

#include "geoflow/tools/simulator/lanes.hpp"

namespace geoflow::simulator {
namespace {

constexpr std::size_t kWeight = 3;
// Normals that deviate by an angle blur by twice as much where what is mirrored is far behind the
// mirror, and less where it is near.
constexpr float kReach = 0.5F;

/// Some columns of an image, of which sums are held over all rows above one, from the first that
/// has anything mirrored to the last.
class Columns {
 public:
  Columns(const Glints& glints, int left)
      : glints_{&glints},
        left_{left},
        count_{std::min(kLanes, static_cast<std::size_t>(glints.width - left))} {
    const auto mirrors = [&](int y) {
      return std::any_of(row(y), row(y) + count_,
                         [](const Rgb& light) { return light[kWeight] > 0; });
    };
    for (; top_ < bottom_ && !mirrors(top_); ++top_) {
    }
    for (; bottom_ > top_ && !mirrors(bottom_ - 1); --bottom_) {
    }
    sums_.resize(static_cast<std::size_t>(bottom_ - top_) + 1);
    for (int y = top_; y < bottom_; ++y) {
      const LaneColours soft = softened(y);
      for (std::size_t i = 0; i < kLanes; ++i) {
        sum_above(y + 1)[i] = sum_above(y)[i] + soft[i];
      }
    }
  }

  void add_to(std::vector<Rgb>& image, float focal_px) const {
    for (int y = top_; y < bottom_; ++y) {
      const std::size_t begin = index(y);
      for (std::size_t i = 0; i < count_; ++i) {
        const Rgb own = row(y)[i];
        if (own[kWeight] > 0) {
          const float rough = glints_->rough[begin + i] / own[kWeight];
          const int reach = static_cast<int>(kReach * rough * focal_px + 0.5F);
          image[begin + i] += reach > 0 ? spread(y, i, reach) : own;
        }
      }
    }
  }

 private:
  [[nodiscard]] std::size_t index(int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(glints_->width) +
           static_cast<std::size_t>(left_);
  }
  [[nodiscard]] const Rgb* row(int y) const { return glints_->light.data() + index(y); }
  [[nodiscard]] LaneColours& sum_above(int y) { return sums_[static_cast<std::size_t>(y - top_)]; }
  [[nodiscard]] const LaneColours& sum_above(int y) const {
    return sums_[static_cast<std::size_t>(y - top_)];
  }

  /// Pixels of a row, each with its neighbours.
  [[nodiscard]] LaneColours softened(int y) const {
    constexpr std::array<float, 5> kBinomial{0.0625F, 0.25F, 0.375F, 0.25F, 0.0625F};
    constexpr int kAside = kBinomial.size() / 2;
    std::array<Rgb, kLanes + kBinomial.size() - 1> near{};
    for (std::size_t i = 0; i < near.size(); ++i) {
      const int x = left_ + static_cast<int>(i) - kAside;
      near[i] = row(y)[std::clamp(x, 0, glints_->width - 1) - left_];
    }
    LaneColours soft{};
    for (std::size_t i = 0; i < kLanes; ++i) {
      for (std::size_t k = 0; k < kBinomial.size(); ++k) {
        soft[i] += kBinomial[k] * near[i + k];
      }
    }
    return soft;
  }

  /// The mean over `reach` pixels upwards and downwards, in the weight of the pixel itself.
  [[nodiscard]] Rgb spread(int y, std::size_t lane, int reach) const {
    const Rgb sum = sum_above(std::min(y + reach + 1, bottom_))[lane] -
                    sum_above(std::max(y - reach, top_))[lane];
    return sum * (row(y)[lane][kWeight] / sum[kWeight]);
  }

  const Glints* glints_;
  int left_;
  std::size_t count_;
  int top_ = 0;
  int bottom_ = glints_->height;
  std::vector<LaneColours> sums_;
};

}  // namespace

void add_glints(const Glints& glints, float focal_px, std::vector<Rgb>& image) {
  constexpr int kStep = static_cast<int>(kLanes);
  tbb::parallel_for(0, glints.width, kStep,
                    [&](int left) { Columns{glints, left}.add_to(image, focal_px); });
}

}  // namespace geoflow::simulator
