#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/daemon/geoflow_protocol.h"

#include "geoflow_client.h"
#include "geoflowd_fixture.hpp"
#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::daemon {
namespace {

constexpr int kPatienceMs = 60'000;

struct Cloud {
  std::uint64_t number = 0;
  std::vector<geoflow_point> points;
};

class GeoflowdCloud : public GeoflowdService {
 protected:
  /// The first cloud with points that a new client is told of.
  [[nodiscard]] Cloud look() const {
    const std::string socket = pose_.string();
    const geoflow_options options{
        .socket = socket.c_str(), .name = "test", .want = GEOFLOW_WANT_CLOUD, .max_rate_hz = 0};
    geoflow_client client{};
    geoflow_event event{};
    Cloud cloud;
    EXPECT_EQ(geoflow_connect(&client, &options), 0) << &client.error[0];
    do {  // the map is empty at first
      EXPECT_EQ(geoflow_next(&client, &event, kPatienceMs), GEOFLOW_RECEIVED) << &client.error[0];
    } while (event.frame.width == 0 && !HasFailure());
    EXPECT_EQ(event.frame.stream, GEOFLOW_CLOUD + 0U);
    EXPECT_EQ(event.frame.bytes, event.frame.width * sizeof(geoflow_point));
    cloud.number = event.frame.frame;
    cloud.points.resize(event.frame.width);
    EXPECT_EQ(geoflow_copy_frame(&client, &event.frame, cloud.points.data()), 0)
        << &client.error[0];
    geoflow_close(&client);
    return cloud;
  }
};

TEST_F(GeoflowdCloud, ShowsTheMapsSurfacesToWhoeverAsksAndToThoseWhoComeLaterAtOnce) {
  const tests::SyntheticRecording wall{.frames = 240, .rate_hz = 4, .shift_px = 1};
  const tests::Process process{daemon({}, replay(wall)), log("daemon")};
  ASSERT_TRUE(manager_.wait_for("READY=1")) << process.err();
  const Cloud cloud = look();
  ASSERT_GT(cloud.points.size(), 100U);
  std::size_t on_wall = 0;
  for (const geoflow_point& point : cloud.points) {
    const auto& [p, normal, sigma_m] = point;
    EXPECT_NEAR(std::hypot(normal[0], normal[1], normal[2]), 1, 1e-5);
    EXPECT_GT(sigma_m, 0);
    // The base is the camera's optical frame, which looks at the wall and its step.
    const auto depth_m = static_cast<double>(p[2]);
    on_wall += depth_m > 0.8 && depth_m < wall.wall_m + 0.1 ? 1 : 0;
  }
  EXPECT_GT(on_wall, cloud.points.size() * 9 / 10);
  EXPECT_GE(look().number, cloud.number);
}

}  // namespace
}  // namespace geoflow::daemon
