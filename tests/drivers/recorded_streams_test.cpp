#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

namespace geoflow::drivers {
namespace {

class Counter : public CameraSink {
 public:
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    ++colors;
    shape = frame.sample.image.shape();
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& /*frame*/) override { ++depths; }
  std::size_t colors = 0;
  std::size_t depths = 0;
  ImageShape shape;
};

TEST(RecordedStreams, StepsThroughAKinectRecording) {
  GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
  auto streams = RecordedStreams::open({.path = path, .color_as_gray = true});
  ASSERT_TRUE(streams) << streams.error().message;
  Counter counter;
  ASSERT_TRUE((*streams)->camera().start(counter));
  auto more = (*streams)->step();
  while (more && *more) {
    more = (*streams)->step();
  }
  ASSERT_TRUE(more) << more.error().message;
  EXPECT_EQ(counter.colors, 400U);
  EXPECT_EQ(counter.depths, 400U);
  EXPECT_EQ(counter.shape,
            (ImageShape{.width = 640, .height = 480, .format = PixelFormat::kGray8}));
  EXPECT_EQ((*streams)->imu(), nullptr);
  EXPECT_EQ((*streams)->now(), (*streams)->info().end);
  EXPECT_EQ((*streams)->decode_statistics().images, 800U);
  EXPECT_DOUBLE_EQ((*streams)->calibration().depth_unit_m, 1.0 / 5000);
}

}  // namespace
}  // namespace geoflow::drivers
