#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "http_client.hpp"
#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::tools {
namespace {

using geoflow::tests::http_get;
using geoflow::tests::Process;
using geoflow::tests::RawConnection;
using geoflow::tests::run_process;
using geoflow::tests::TemporaryDirectory;
using nlohmann::json;
using std::chrono::seconds;
using testing::HasSubstr;

/// `geoflow view` and geoflowd as programs.
class ViewProgram : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<Process> start_daemon() const {
    return std::make_unique<Process>(
        std::vector<std::string>{GEOFLOWD_PROGRAM, "--replay", recording_, "--loop",
                                 "--pose-socket", pose_, "--control-socket", control_},
        folder_.path() / "daemon");
  }
  /// Starts the view and waits until it listens.
  void start_view() {
    view_ = std::make_unique<Process>(
        std::vector<std::string>{GEOFLOW_PROGRAM, "view", "--json", "--port", "0", "--pose-socket",
                                 pose_, "--socket", control_},
        folder_.path() / "view");
    const HostTime deadline = HostClock::now() + seconds{30};
    while (view_->out().find('\n') == std::string::npos) {
      if (HostClock::now() > deadline) {
        throw std::runtime_error{"the view does not start: " + view_->err()};
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    }
    port_ = json::parse(view_->out()).at("port").get<std::uint16_t>();
  }
  [[nodiscard]] std::unique_ptr<RawConnection> open_events() const {
    auto page = std::make_unique<RawConnection>(port_);
    page->send("GET /events HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port_) + "\r\n\r\n");
    return page;
  }

  TemporaryDirectory folder_;
  std::string recording_ = (folder_.path() / "recording").string();
  std::string pose_ = (folder_.path() / "pose.sock").string();
  std::string control_ = (folder_.path() / "ctl.sock").string();
  std::unique_ptr<Process> view_;
  std::uint16_t port_ = 0;
};

TEST_F(ViewProgram, ShowsADaemonThatComesAndGoesAndComesAgain) {
  geoflow::tests::write_synthetic_recording(recording_, {.frames = 150});
  start_view();
  const auto page = open_events();
  EXPECT_THAT(page->read_until("\"up\":false", seconds{10}), HasSubstr("is geoflowd running?"));
  auto daemon = start_daemon();
  EXPECT_THAT(page->read_until("event: status", seconds{30}), HasSubstr("\"up\":true"));
  EXPECT_THAT(page->read_until("event: pose", seconds{30}), HasSubstr("event: pose"));
  daemon.reset();  // as if it crashed
  EXPECT_THAT(page->read_until("the daemon has ended", seconds{10}), HasSubstr("event: link"));
  daemon = start_daemon();
  const auto again = open_events();
  EXPECT_THAT(again->read_until("\"up\":true", seconds{30}), HasSubstr("\"up\":true"));
  EXPECT_THAT(again->read_until("p_odom_base", seconds{30}), HasSubstr("p_odom_base"));
  EXPECT_EQ(http_get(port_, "/").status, 200);
  view_->send_signal(SIGTERM);
  EXPECT_EQ(view_->wait(seconds{10}), 0);
}

TEST_F(ViewProgram, ThePageNeedsNoNetworkAndIsSmall) {
  start_view();
  const std::string page = http_get(port_, "/").body;
  EXPECT_LT(page.size(), 2U << 20U);
  EXPECT_EQ(page.find("{{"), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos);
  EXPECT_EQ(page.find("innerHTML"), std::string::npos);
}

TEST_F(ViewProgram, BeyondLoopbackItMakesAToken) {
  const auto start = [&](const char* address) {
    Process view{{GEOFLOW_PROGRAM, "view", "--json", "--port", "0", "--listen", address},
                 folder_.path() / "open"};
    const HostTime deadline = HostClock::now() + seconds{30};
    while (view.out().find('\n') == std::string::npos && HostClock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    }
    return json::parse(view.out()).at("url").get<std::string>();
  };
  const std::string first = start("0.0.0.0");
  const std::string second = start("0.0.0.0");
  EXPECT_THAT(first, testing::ContainsRegex("/[?]token=[0-9a-f]{32}$"));
  EXPECT_NE(first.substr(first.find('=')), second.substr(second.find('=')));
  const auto wrong =
      run_process({GEOFLOW_PROGRAM, "view", "--listen", "robot"}, folder_.path() / "wrong");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("robot: not a numeric IPv4 or IPv6 address"));
}

}  // namespace
}  // namespace geoflow::tools
