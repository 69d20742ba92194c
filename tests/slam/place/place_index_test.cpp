#include "place/place_index.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "tests/support/data.hpp"

#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/overlap.hpp"
#include "odometry/frame.hpp"
#include "recorded_places.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"

namespace geoflow::slam {
namespace {

using tests::RecordedPlaces;

constexpr std::size_t kFeatures = 600;

KeyframeId id_of(std::size_t i) {
  return KeyframeId{static_cast<std::uint32_t>(i)};
}

std::size_t index_of(KeyframeId id) {
  return static_cast<std::size_t>(id);
}

/// Views of features that have nothing to do with each other.
PlaceView random_view(std::mt19937_64& random) {
  PlaceView view;
  view.features.resize(kFeatures);
  for (OrbFeature& feature : view.features) {
    std::ranges::generate(feature.descriptor, std::ref(random));
  }
  return view;
}

/// The same with each bit wrong with a probability of 1/8: a distance of 32 bits on average, as
/// between two views of one feature.
PlaceView seen_again(PlaceView view, std::mt19937_64& random) {
  for (OrbFeature& feature : view.features) {
    for (std::uint64_t& word : feature.descriptor) {
      const std::uint64_t a = random();
      const std::uint64_t b = random();
      word ^= a & b & random();
    }
  }
  return view;
}

bool same(const std::vector<PlaceCandidate>& a, const std::vector<PlaceCandidate>& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) {
    return x.keyframe == y.keyframe && x.score == y.score;
  });
}

TEST(PlaceIndex, KnowsEveryViewAgain) {
  constexpr std::size_t kViews = 100;
  std::mt19937_64 random{1};
  PlaceIndex index;
  std::vector<PlaceView> views;
  for (std::size_t i = 0; i < kViews; ++i) {
    views.push_back(random_view(random));
    ASSERT_TRUE(index.add(id_of(i), views.back()));
  }
  EXPECT_EQ(index.size(), kViews);
  for (std::size_t i = 0; i < kViews; ++i) {
    const auto found = index.query(seen_again(views[i], random), 2);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].keyframe, id_of(i));
    EXPECT_GT(found[0].score, 10 * found[1].score);
  }
  const auto unknown = index.query(random_view(random), kViews);
  EXPECT_TRUE(unknown.empty() || unknown[0].score < 0.02);
}

TEST(PlaceIndex, KnowsNothingOfWhatWasTakenOut) {
  constexpr std::size_t kViews = 50;
  std::mt19937_64 random{2};
  PlaceIndex index;
  PlaceIndex without;
  std::vector<PlaceView> views;
  for (std::size_t i = 0; i < kViews; ++i) {
    views.push_back(random_view(random));
    index.add(id_of(i), views.back());
    if (i % 2 == 0) {
      without.add(id_of(i), views.back());
    }
  }
  for (std::size_t i = 1; i < kViews; i += 2) {
    index.remove(id_of(i), views[i]);
    EXPECT_FALSE(index.contains(id_of(i)));
  }
  index.remove(id_of(kViews), views[0]);
  EXPECT_EQ(index.size(), kViews / 2);
  for (const PlaceView& view : views) {
    EXPECT_TRUE(same(index.query(view, kViews), without.query(view, kViews)));
  }
  // What is filed next takes the room of what was taken out.
  const std::size_t before = index.memory_bytes();
  for (std::size_t i = 1; i < kViews; i += 2) {
    index.add(id_of(i), views[i]);
    EXPECT_EQ(index.query(views[i], 1).at(0).keyframe, id_of(i));
  }
  EXPECT_LE(index.memory_bytes(), before + before / 4);
}

TEST(PlaceIndex, HasNoAnswerWithoutFeaturesOrKeyframes) {
  std::mt19937_64 random{3};
  PlaceIndex index;
  EXPECT_TRUE(index.query(random_view(random), 5).empty());
  index.add(id_of(0), PlaceView{});
  EXPECT_TRUE(index.query(random_view(random), 5).empty());
  EXPECT_TRUE(index.query(PlaceView{}, 5).empty());
}

TEST(PlaceIndex, NeedsLessThan10MBForAThousandKeyframes) {
  constexpr std::size_t kViews = 1000;
  constexpr std::size_t kMost = 10'000'000;
  std::mt19937_64 random{4};
  PlaceIndex index;
  const std::size_t empty = index.memory_bytes();
  for (std::size_t i = 0; i < kViews; ++i) {
    index.add(id_of(i), random_view(random));
  }
  const std::size_t thousand = index.memory_bytes();
  EXPECT_LT(thousand, kMost + empty);
  for (std::size_t i = kViews; i < 2 * kViews; ++i) {
    index.add(id_of(i), random_view(random));
  }
  EXPECT_LT(index.memory_bytes() - thousand, kMost);
}

TEST(Peaks, AreApart) {
  const std::vector<PlaceCandidate> ranking{{.keyframe = id_of(10), .score = 0.9},
                                            {.keyframe = id_of(11), .score = 0.8},
                                            {.keyframe = id_of(30), .score = 0.7},
                                            {.keyframe = id_of(7), .score = 0.6},
                                            {.keyframe = id_of(6), .score = 0.5}};
  const auto found = peaks(ranking, 3, 3);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].keyframe, id_of(10));
  EXPECT_EQ(found[1].keyframe, id_of(30));
  EXPECT_EQ(found[2].keyframe, id_of(6));
  EXPECT_EQ(peaks(ranking, 1, 3).size(), 1U);
}

/// Views of kitchen-400, each fourth frame a keyframe.
class PlaceIndexOnKitchen : public testing::Test {
 protected:
  static constexpr std::size_t kFrames = 400;
  static constexpr std::size_t kStep = 4;

  void SetUp() override {
    GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
    places_ = std::make_unique<RecordedPlaces>(path, kFrames);
    for (std::size_t i = 0; i < kFrames; i += kStep) {
      keyframes_.push_back(places_->look(i));
    }
  }
  /// Whether two frames see the same: most of the image at this recording's distances of 2 m.
  [[nodiscard]] bool near(std::size_t a, std::size_t b) const {
    constexpr double kNearM = 0.3;
    constexpr double kNearRad = 0.35;
    const Vector6d between = (places_->reference(a).inverse() * places_->reference(b)).log();
    return between.tail<3>().norm() < kNearM && between.head<3>().norm() < kNearRad;
  }
  /// The share of a frame's depth that a keyframe sees too.
  [[nodiscard]] double overlap(const Frame& frame, std::size_t i, std::size_t keyframe) const {
    const SE3& T_world_keyframe = places_->reference(keyframe);
    const SE3& T_world_cam = places_->reference(i);
    return depth_agreement(*frame.cloud, *keyframes_[keyframe / kStep].cloud,
                           T_world_keyframe.inverse() * T_world_cam)
        .agreeing;
  }
  /// All keyframes but those within `gap` frames.
  [[nodiscard]] PlaceIndex index_without(std::size_t frame, std::size_t gap) const {
    PlaceIndex index;
    for (std::size_t k = 0; k < kFrames; k += kStep) {
      if (k + gap <= frame || frame + gap <= k) {
        index.add(id_of(k), *keyframes_[k / kStep].place);
      }
    }
    return index;
  }

  std::unique_ptr<RecordedPlaces> places_;
  std::vector<Frame> keyframes_;
};

TEST_F(PlaceIndexOnKitchen, RanksARevisitedViewAmongTheFirstFive) {
  constexpr std::size_t kGap = 30;  // a second in which most has left the image, and come back
  std::size_t asked = 0;
  std::size_t found = 0;
  for (std::size_t i = 2; i < kFrames; i += 3 * kStep) {
    bool revisited = false;
    for (std::size_t k = 0; k < kFrames; k += kStep) {
      revisited = revisited || ((k + kGap <= i || i + kGap <= k) && near(i, k));
    }
    if (revisited) {
      const Frame frame = places_->look(i);
      const auto ranking = index_without(i, kGap).query(*frame.place, 5);
      const bool known = std::ranges::any_of(ranking, [&](const PlaceCandidate& candidate) {
        return overlap(frame, i, index_of(candidate.keyframe)) > 0.5;
      });
      ++asked;
      found += known ? 1U : 0U;
    }
  }
  EXPECT_GT(asked, 25U);
  EXPECT_GE(static_cast<double>(found), 0.9 * static_cast<double>(asked)) << "of " << asked;
}

TEST_F(PlaceIndexOnKitchen, GivesMirrorImagesNoScore) {
  const PlaceIndex index = index_without(0, 0);
  double least = 1;
  double most = 0;
  for (std::size_t i = 2; i < kFrames; i += 3 * kStep) {
    least = std::min(least, index.query(*places_->look(i).place, 1).at(0).score);
    const auto mirrored = index.query(*places_->look_mirrored(i).place, 1);
    most = std::max(most, mirrored.empty() ? 0 : mirrored[0].score);
  }
  // The worst of the frames 66 ms from a keyframe, blurred or not, and whatever looks most like a
  // kitchen in the mirror.
  EXPECT_GT(least, most);
}

}  // namespace
}  // namespace geoflow::slam
