#include "geoflow/tools/emulator/recorded_world.hpp"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/world.hpp"
#include "tests/support/data.hpp"

namespace geoflow::emulator {
namespace {

/// The samples of one round of a recording, or those up to `limit`.
std::vector<WorldSample> samples_of(World& world, std::size_t limit) {
  std::vector<WorldSample> samples;
  while (samples.size() < limit) {
    auto sample = world.next();
    EXPECT_TRUE(sample) << (sample ? "" : sample.error().message);
    if (!sample || !sample->has_value()) {
      break;
    }
    samples.push_back(std::move(**sample));
  }
  return samples;
}

TEST(RecordedWorld, PlaysARecordingFromZeroAndEnds) {
  GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
  auto world = open_recorded_world({.path = path});
  ASSERT_TRUE(world) << world.error().message;
  // Two images of each of 400 frames, 30 frames a second.
  const auto samples = samples_of(**world, 1000);
  ASSERT_EQ(samples.size(), 800U);
  EXPECT_EQ(samples.front().t_sent, Duration{0});
  EXPECT_NEAR(to_seconds(samples.back().t_sent), 399.0 / 30.0, 1e-3);
  std::size_t depth = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    EXPECT_GE(samples[i].t_sent, samples[i - 1].t_sent);
    depth += std::holds_alternative<DepthFrame>(samples[i].sample) ? 1U : 0U;
  }
  EXPECT_NEAR(static_cast<double>(depth), 400.0, 1.0);
  EXPECT_NEAR((*world)->calibration().camera.fx, 517.0, 2.0);
}

TEST(RecordedWorld, GoesRoundWithoutItsTimeEverGoingBack) {
  GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
  auto world = open_recorded_world({.path = path, .loop = true});
  ASSERT_TRUE(world) << world.error().message;
  const auto samples = samples_of(**world, 804);
  ASSERT_EQ(samples.size(), 804U);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_GE(samples[i].t_sent, samples[i - 1].t_sent) << "sample " << i;
  }
  EXPECT_EQ(samples[800].t_sent_recorded, samples[0].t_sent_recorded);
  EXPECT_EQ(samples[799].t_sent_recorded - samples[0].t_sent_recorded,
            samples[799].t_sent - samples[0].t_sent);
  // The first frame of the second round comes one frame after the last of the first.
  EXPECT_NEAR(to_seconds(samples[800].t_sent), 400.0 / 30.0, 2e-3);
}

TEST(RecordedWorld, RefusesAFolderThatIsNoRecording) {
  const tests::TemporaryDirectory directory;
  const auto world = open_recorded_world({.path = directory.path()});
  ASSERT_FALSE(world);
  EXPECT_NE(world.error().message.find(directory.path().string()), std::string::npos)
      << world.error().message;
}

}  // namespace
}  // namespace geoflow::emulator
