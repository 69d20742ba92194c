#include <cstdint>
#include <string>

#include "geoflow/hal/unique_fd.hpp"

#include "server_fixture.hpp"

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

TEST_F(ServerTest, ControlAnswersHelpStatusAndErrors) {
  const UniqueFd fd = raw_socket(config_.control, SOCK_STREAM);
  LineReader lines{fd.get()};
  EXPECT_EQ((*lines.next())["hello"], "geoflowd");
  say(fd.get(), "{\"cmd\":\"status\",\"id\":\"a\"}\n{\"cmd\":\"help\"}\nnonsense\n");
  const auto status = lines.next();
  EXPECT_EQ((*status)["status"]["state"], "fine");
  EXPECT_EQ((*status)["id"], "a");
  EXPECT_TRUE((*lines.next())["commands"].contains("watch"));
  const auto error = lines.next();
  EXPECT_EQ((*error)["ok"], false);
  EXPECT_EQ((*error)["error"]["code"], "invalid_argument");
}

TEST_F(ServerTest, ControlWatchesPoses) {
  const UniqueFd fd = raw_socket(config_.control, SOCK_STREAM);
  LineReader lines{fd.get()};
  (void)lines.next();
  say(fd.get(), "{\"cmd\":\"watch\"}\n");
  EXPECT_EQ((*lines.next())["reply"], "watch");
  publish(3);
  const auto line = lines.next();
  EXPECT_EQ((*line)["pose"]["frame"], 3);
  say(fd.get(), "{\"cmd\":\"unwatch\"}\n");
  EXPECT_EQ((*lines.next())["reply"], "unwatch");
  publish(4);
  say(fd.get(), "{\"cmd\":\"status\"}\n");
  EXPECT_EQ((*lines.next())["reply"], "status");
}

TEST_F(ServerTest, ControlCutsOffLongLinesFloodsAndDeafWatchers) {
  const UniqueFd longwinded = raw_socket(config_.control, SOCK_STREAM);
  LineReader long_lines{longwinded.get()};
  (void)long_lines.next();
  say(longwinded.get(), std::string(5000, 'x'));
  EXPECT_THAT((*long_lines.next())["error"]["message"].get<std::string>(), HasSubstr("4096"));
  EXPECT_FALSE(long_lines.next());

  const UniqueFd flood = raw_socket(config_.control, SOCK_STREAM);
  std::string requests;
  for (int i = 0; i < 200; ++i) {
    requests += "{\"cmd\":\"help\"}\n";
  }
  say(flood.get(), requests);
  EXPECT_TRUE(eventually([this] { return clients() == 0; }));

  const UniqueFd deaf = raw_socket(config_.control, SOCK_STREAM);
  LineReader deaf_lines{deaf.get()};
  (void)deaf_lines.next();
  say(deaf.get(), "{\"cmd\":\"watch\"}\n");
  (void)deaf_lines.next();
  for (std::uint64_t frame = 0; frame < 100; ++frame) {
    publish(frame);
  }
  EXPECT_TRUE(eventually([this] { return clients() == 0; }));
}

}  // namespace
}  // namespace geoflow::daemon
