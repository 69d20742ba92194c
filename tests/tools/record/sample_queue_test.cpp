#include "record/sample_queue.hpp"

#include <chrono>
#include <variant>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

using std::chrono::milliseconds;

Arrival<ImuClock, ImuSample> imu_at(int t_ms) {
  return {.t_device = DeviceTime<ImuClock>{milliseconds{t_ms}},
          .t_arrival = HostTime{milliseconds{t_ms}},
          .sample = {}};
}

TEST(SampleQueue, KeepsTheOrderOfAllKinds) {
  SampleQueue queue{{}};
  queue.on_imu(imu_at(1));
  queue.on_color({});
  queue.on_legs({});
  queue.on_imu(imu_at(2));
  for (const std::size_t kind : {2U, 0U, 3U, 2U}) {
    const auto sample = queue.pop(Duration::zero());
    ASSERT_TRUE(sample);
    EXPECT_EQ(sample->index(), kind);
  }
  EXPECT_FALSE(queue.pop(milliseconds{1}));
}

TEST(SampleQueue, LosesTheNewestWhenItIsFullAndCounts) {
  SampleQueue queue{{.images = 2, .samples = 3}};
  for (int i = 0; i < 4; ++i) {
    queue.on_imu(imu_at(i));
    queue.on_depth({});
  }
  EXPECT_EQ(queue.dropped(), 1U + 2U);
  // Room of one kind is none of the other's.
  ASSERT_EQ(queue.pop(Duration::zero())->index(), 2U);
  queue.on_color({});
  EXPECT_EQ(queue.dropped(), 4U);
  queue.on_imu(imu_at(9));
  EXPECT_EQ(queue.dropped(), 4U);
  HostTime last;
  while (const auto sample = queue.pop(Duration::zero())) {
    if (const auto* imu = std::get_if<Arrival<ImuClock, ImuSample>>(&*sample)) {
      last = imu->t_arrival;
    }
  }
  EXPECT_EQ(last, HostTime{milliseconds{9}});
}

}  // namespace
}  // namespace geoflow::tools
