#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "protocol/control_request.hpp"
#include "server/acceptor.hpp"
#include "server/authority.hpp"
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

TEST(Authority, IsRootsTheDaemonsUsersAndTheGroups) {
  const Authority authority{1000, 200, "robots"};
  const auto peer = [](uid_t uid, gid_t gid, std::vector<gid_t> groups) {
    return Connection{.fd = {}, .pid = 77, .uid = uid, .gid = gid, .groups = std::move(groups)};
  };
  EXPECT_TRUE(authority.permits(peer(0, 0, {})));
  EXPECT_TRUE(authority.permits(peer(1000, 1000, {})));
  EXPECT_TRUE(authority.permits(peer(1001, 200, {})));
  EXPECT_TRUE(authority.permits(peer(1001, 1001, {5, 200, 7})));
  EXPECT_FALSE(authority.permits(peer(1001, 1001, {5, 7})));
  const std::string refusal = authority.refusal(peer(1001, 1001, {}), "reload");
  EXPECT_THAT(refusal, HasSubstr("reload"));
  EXPECT_THAT(refusal, HasSubstr("user 1001 (process 77)"));
  EXPECT_THAT(refusal, HasSubstr("group robots"));
}

TEST(Authority, NeedsAGroupThatIsThere) {
  const auto unknown = Authority::create("no-such-group");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(unknown.error().message, HasSubstr("socket.group: no group is named no-such-group"));
  EXPECT_TRUE(Authority::create(""));
}

TEST_F(ServerTest, ControlAnswersChangesWhenTheyAreDone) {
  const UniqueFd fd = raw_socket(config_.control, SOCK_STREAM);
  LineReader lines{fd.get()};
  (void)lines.next();
  say(fd.get(),
      "{\"cmd\":\"map\",\"do\":\"save\",\"id\":1}\n{\"cmd\":\"reset\",\"id\":2}\n{\"cmd\":"
      "\"config\"}\n");
  EXPECT_EQ((*lines.next())["config"]["map.file"], "\"\"");  // what needs no time comes first
  on_loop([this] {
    ASSERT_EQ(changes_.size(), 2U);
    EXPECT_EQ(changes_[0].first, Change::kSaveMap);
    EXPECT_EQ(changes_[1].first, Change::kReset);
    control_->conclude(changes_[1].second, fail(ErrorCode::kSystem, "no room"));
    control_->conclude(changes_[0].second, nlohmann::json{{"saved", "a.map"}});
  });
  const auto failed = lines.next();
  EXPECT_EQ((*failed)["id"], 2);
  EXPECT_EQ((*failed)["ok"], false);
  EXPECT_EQ((*failed)["error"]["code"], "system");
  EXPECT_EQ((*failed)["error"]["message"], "no room");
  const auto saved = lines.next();
  EXPECT_EQ((*saved)["id"], 1);
  EXPECT_EQ((*saved)["reply"], "map");
  EXPECT_EQ((*saved)["saved"], "a.map");
}

TEST_F(ServerTest, ControlForgetsTheChangeOfAClientThatHasGone) {
  {
    const UniqueFd fd = raw_socket(config_.control, SOCK_STREAM);
    LineReader lines{fd.get()};
    (void)lines.next();
    say(fd.get(), "{\"cmd\":\"reload\"}\n{\"cmd\":\"status\"}\n");
    EXPECT_EQ((*lines.next())["reply"], "status");
  }
  ASSERT_TRUE(eventually([this] { return clients() == 0; }));
  const UniqueFd later = raw_socket(config_.control, SOCK_STREAM);  // has the same descriptor
  LineReader lines{later.get()};
  (void)lines.next();
  on_loop([this] {
    ASSERT_EQ(changes_.size(), 1U);
    control_->conclude(changes_[0].second, nlohmann::json::object());
  });
  say(later.get(), "{\"cmd\":\"status\"}\n");
  EXPECT_EQ((*lines.next())["reply"], "status");
}

/// What another user's process hears when it asks for a reload: written to a file by that process.
nlohmann::json asked_as_nobody(const std::filesystem::path& control,
                               const std::filesystem::path& answer) {
  std::ofstream file{answer};
  EXPECT_TRUE(as_nobody([&] {
    auto client = ControlClient::connect(control);
    if (!client) {
      return false;
    }
    const auto reply = client->request({{"cmd", "reload"}}, std::chrono::seconds{5});
    const auto status = client->request({{"cmd", "status"}}, std::chrono::seconds{5});
    file << nlohmann::json{{"refused", reply ? "" : reply.error().message},
                           {"status", status ? *status : nlohmann::json{}}};
    file.close();
    return true;
  }));
  file.close();
  std::ifstream heard{answer};
  return nlohmann::json::parse(heard, nullptr, false);
}

TEST_F(ServerTest, ControlRefusesAnotherUsersChangesAndAnswersHisQuestions) {
  if (::geteuid() != 0) {
    GTEST_SKIP() << "only root can ask as somebody else";
  }
  ::chmod(config_.control.c_str(), 0666);
  ::chmod(directory_.path().c_str(), 0755);
  const nlohmann::json heard = asked_as_nobody(config_.control, directory_.path() / "answer");
  ASSERT_TRUE(heard.is_object());
  EXPECT_THAT(heard["refused"].get<std::string>(), HasSubstr("reload: not for user 65534"));
  EXPECT_EQ(heard["status"]["status"]["state"], "fine");
  on_loop([this] { EXPECT_TRUE(changes_.empty()); });
}

}  // namespace
}  // namespace geoflow::daemon
