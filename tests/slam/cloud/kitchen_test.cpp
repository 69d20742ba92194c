#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"

/// Real depth: kitchen-400 (7-Scenes RedKitchen, Kinect) against its reference, which is good to
/// about 1 cm.
namespace geoflow::slam {
namespace {

class DepthClouds : public CameraSink {
 public:
  explicit DepthClouds(const Calibration& calibration)
      : grid_{CellGrid::create(calibration.camera, DepthCloudConfig{}.cell_px).value()},
        unit_m_{calibration.depth_unit_m} {}
  void on_color(const Arrival<CameraClock, ColorFrame>& /*frame*/) override {}
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    clouds.emplace_back(grid_, DepthCloud::Pixels{unit_m_}, DepthCloudConfig{});
    ASSERT_TRUE(clouds.back().build(frame.sample.image));
  }
  std::vector<DepthCloud> clouds;

 private:
  std::shared_ptr<const CellGrid> grid_;
  double unit_m_;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// PCL 1.13's GICP at a 0.02 m voxel has medians of 2.5 mm and 0.087 degrees on neighbouring
/// frames, 4.2 mm and 0.153 degrees over 3, 5.4 mm and 0.200 degrees over 5 frames.
TEST(GicpKitchen, FromIdentityAsAccurateAsPcl) {
  GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
  const auto reference = tools::read_trajectory(path / "groundtruth.txt");
  ASSERT_TRUE(reference);
  auto recording = drivers::RecordedStreams::open({.path = path, .color_as_gray = true});
  ASSERT_TRUE(recording) << recording.error().message;
  DepthClouds sink{(*recording)->calibration()};
  ASSERT_TRUE((*recording)->camera().start(sink));
  constexpr std::size_t kFrames = 105;
  while (sink.clouds.size() < kFrames) {
    const auto more = (*recording)->step();
    ASSERT_TRUE(more && *more);
  }
  struct Bound {
    std::size_t step;
    double translation_m;
    double rotation_deg;
    double nees;
  };
  for (const Bound& bound :
       {Bound{1, 2.4e-3, 0.087, 6}, Bound{3, 4.1e-3, 0.15, 20}, Bound{5, 5.4e-3, 0.2, 30}}) {
    std::vector<double> translation;
    std::vector<double> rotation;
    std::vector<double> nees;
    for (std::size_t i = 0; i + bound.step < kFrames && i < 100; ++i) {
      const RegistrationResult result =
          register_clouds(sink.clouds[i + bound.step], sink.clouds[i], SE3{}, {});
      EXPECT_EQ(result.degenerate_directions, 0) << "pair " << i;
      const SE3 T = reference->poses[i].pose.inverse() * reference->poses[i + bound.step].pose;
      const Vector6d error = (result.T_target_source.inverse() * T).log();
      translation.push_back(error.tail<3>().norm());
      rotation.push_back(error.head<3>().norm());
      nees.push_back(error.dot(result.information * error));
    }
    constexpr double kDegree = 0.017453292519943295;
    EXPECT_LE(median(translation), bound.translation_m) << "step " << bound.step;
    EXPECT_LE(median(rotation), bound.rotation_deg * kDegree) << "step " << bound.step;
    EXPECT_LE(median(nees), bound.nees) << "step " << bound.step;
  }
}

}  // namespace
}  // namespace geoflow::slam
