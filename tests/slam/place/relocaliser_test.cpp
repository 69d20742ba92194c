#include "place/relocaliser.hpp"

#include <cstddef>
#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "tests/support/data.hpp"

#include "map/map.hpp"
#include "map/map_builder.hpp"
#include "odometry/frame.hpp"
#include "recorded_places.hpp"

/// Places of kitchen-400 (7-Scenes RedKitchen), and their mirror images as places that the map does
/// not have.
namespace geoflow::slam {
namespace {

using tests::RecordedPlaces;

class RelocaliserOnKitchen : public testing::Test {
 protected:
  void SetUp() override {
    GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
    places_ = std::make_unique<RecordedPlaces>(path, kLast + 1);
    MapBuilder builder{places_->config(), places_->gicp(), places_->calibration(), nullptr};
    for (std::size_t i = 0; i < kMapped; i += kKeyframeStep) {
      Frame frame = places_->look(i);
      frame.T_odom_cam = reference(i);
      builder.insert(map_, frame, Matrix6d::Zero());
    }
  }

  /// The map's frame is the reference's world.
  [[nodiscard]] const SE3& reference(std::size_t i) const { return places_->reference(i); }

  [[nodiscard]] std::optional<Relocation> find(const Frame& frame) const {
    const Relocaliser relocaliser{places_->config(), places_->gicp(), places_->camera()};
    return relocaliser.find(map_, frame, SE3{});
  }

  static constexpr std::size_t kLast = 150;
  static constexpr std::size_t kMapped = 100;
  static constexpr std::size_t kKeyframeStep = 10;

  std::unique_ptr<RecordedPlaces> places_;
  Map map_;
};

TEST_F(RelocaliserOnKitchen, FindsFramesBetweenKeyframesWithoutAGuess) {
  for (std::size_t i = 5; i < kMapped; i += kKeyframeStep) {
    const auto found = find(places_->look(i));
    ASSERT_TRUE(found) << "frame " << i;
    const Vector6d error = (reference(i).inverse() * found->T_odom_cam).log();
    // What this recording's calibration and reference leave of a pose from one image.
    EXPECT_LT(error.tail<3>().norm(), 0.06) << "frame " << i;
    EXPECT_LT(error.head<3>().norm(), 0.03) << "frame " << i;
  }
}

TEST_F(RelocaliserOnKitchen, FindsNoMirrorImageAnywhere) {
  for (std::size_t i = 0; i <= kLast; i += 3) {
    EXPECT_FALSE(find(places_->look_mirrored(i))) << "frame " << i;
  }
}

TEST_F(RelocaliserOnKitchen, IsNeverFarOffAfterTheMapEnds) {
  for (std::size_t i = kMapped; i <= kLast; i += 5) {
    const auto found = find(places_->look(i));
    if (found) {
      const Vector6d error = (reference(i).inverse() * found->T_odom_cam).log();
      EXPECT_LT(error.tail<3>().norm(), 0.15) << "frame " << i;
    }
  }
}

}  // namespace
}  // namespace geoflow::slam
