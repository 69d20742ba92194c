#include "config/reload.hpp"

#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/daemon/config.hpp"

namespace geoflow::daemon {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(Reload, TakesWhatCanChangeAndNamesTheRest) {
  const Config started;
  Config running = started;
  Config read = started;
  read.map.save_interval = seconds{5};
  read.socket.clients = 3;
  read.map.file = "other.map";
  read.slam.switches.legs = false;
  const Reload reload = take_over(read, started, running);
  EXPECT_THAT(reload.changed, ElementsAre("socket.clients", "map.save_interval_s"));
  EXPECT_THAT(reload.restart, ElementsAre("slam.switches.legs", "map.file"));
  EXPECT_EQ(running.map.save_interval, seconds{5});
  EXPECT_EQ(running.socket.clients, 3);
  EXPECT_EQ(running.map.file, started.map.file);
  EXPECT_TRUE(running.slam.switches.legs);
}

TEST(Reload, ComparesWithWhatHoldsNow) {
  const Config started;
  Config running = started;
  Config read = started;
  read.source.loop = true;
  EXPECT_THAT(take_over(read, started, running).changed, ElementsAre("source.loop"));
  EXPECT_THAT(take_over(read, started, running).changed, IsEmpty());
  EXPECT_THAT(take_over(started, started, running).changed, ElementsAre("source.loop"));
  EXPECT_FALSE(running.source.loop);
}

}  // namespace
}  // namespace geoflow::daemon
