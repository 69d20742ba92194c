#include "geoflow/slam/saved_map.hpp"

#include <cstddef>
#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/mapping.hpp"
#include "tests/support/data.hpp"

#include "slam/place/recorded_places.hpp"

/// A robot that wakes up in a saved map of kitchen-400 (7-Scenes RedKitchen), somewhere.
namespace geoflow::slam {
namespace {

using tests::RecordedPlaces;

constexpr std::size_t kFrames = 400;
constexpr std::size_t kMapped = 200;
/// 2 s at 30 frames/s.
constexpr std::size_t kSoon = 60;

class SavedMapOfKitchen : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (const auto path = geoflow::tests::data_path("kitchen-400")) {
      places = std::make_unique<RecordedPlaces>(*path, kFrames);
      const auto first = core(nullptr);
      for (std::size_t i = 0; i < kMapped; ++i) {
        EXPECT_EQ(follow(*first, places->packet(i)).status, TrackingStatus::kTracking);
      }
      made = first->final_trajectory();
      const geoflow::tests::TemporaryDirectory directory;
      const auto file = directory.path() / "kitchen.map";
      ASSERT_TRUE(save_map(*first->snapshot(), file));
      map = load_map(file).value();  // the file stays readable when its name is gone
    }
  }
  static void TearDownTestSuite() {
    map.reset();
    places.reset();
  }
  void SetUp() override {
    GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
    ASSERT_TRUE(map) << path;
  }

  static std::unique_ptr<Core> core(const StoredMap* saved) {
    return Core::create(places->calibration(), places->config(), nullptr, saved).value();
  }

  /// In lock step with mapping.
  static PoseEstimate follow(Core& core, const SyncedPacket& packet) {
    const PoseEstimate estimate = core.process(packet);
    while (const std::optional<MappingTask> task = core.take_mapping_task()) {
      core.apply(optimise(*task));
    }
    return estimate;
  }

  /// How far an estimate in the saved map is from where the map's maker saw the same frame from
  /// [m].
  static double error_m(const PoseEstimate& estimate, std::size_t i) {
    const SE3 T_map_base = estimate.T_map_odom * estimate.T_odom_base;
    return (T_map_base.translation() - made[i].pose.translation()).norm();
  }

  static std::unique_ptr<RecordedPlaces> places;
  static std::shared_ptr<const StoredMap> map;
  static Trajectory made;  ///< the way of the map's maker, in the map
};
std::unique_ptr<RecordedPlaces> SavedMapOfKitchen::places;
std::shared_ptr<const StoredMap> SavedMapOfKitchen::map;
Trajectory SavedMapOfKitchen::made;

TEST_F(SavedMapOfKitchen, IsFoundAgainWithinTwoSecondsFromAnywhereInIt) {
  // Two ways through one map differ by as much as either from the reference: 0.03 m rms.
  for (const std::size_t begin : {20U, 60U, 100U, 140U}) {
    const auto woken = core(map.get());
    std::optional<std::size_t> found;
    for (std::size_t i = begin; i < begin + kSoon && i < kMapped; ++i) {
      const PoseEstimate estimate = follow(*woken, places->packet(i));
      if (estimate.status == TrackingStatus::kTracking) {
        found = found.value_or(i);
        EXPECT_EQ(estimate.map_id, 0U);
        EXPECT_LT(error_m(estimate, i), 0.03) << "frame " << i << ", woken at " << begin;
      } else {
        ASSERT_FALSE(found) << "lost again at frame " << i;
        EXPECT_EQ(estimate.status, TrackingStatus::kRelocalising) << "frame " << i;
        EXPECT_NE(estimate.map_id, 0U);
      }
    }
    ASSERT_TRUE(found) << "woken at " << begin;
    EXPECT_LE(*found - begin, kSoon);
  }
}

TEST_F(SavedMapOfKitchen, IsNotFoundInItsMirrorImage) {
  const auto woken = core(map.get());
  for (std::size_t i = 0; i < kFrames; ++i) {
    const PoseEstimate estimate = follow(*woken, places->packet_mirrored(i));
    ASSERT_NE(estimate.status, TrackingStatus::kTracking) << "frame " << i;
    EXPECT_NE(estimate.map_id, 0U);
  }
  EXPECT_EQ(summary(*woken->snapshot()).parts, 2U);
}

TEST_F(SavedMapOfKitchen, GrowsAndIsTheSameMapTheNextTime) {
  const auto woken = core(map.get());
  for (std::size_t i = kMapped / 2; i < kFrames; ++i) {
    follow(*woken, places->packet(i));
  }
  const MapSummary before = summary(*map);
  const MapSummary after = summary(*woken->snapshot());
  EXPECT_EQ(after.parts, 1U);
  EXPECT_GT(after.keyframes, before.keyframes);
}

}  // namespace
}  // namespace geoflow::slam
