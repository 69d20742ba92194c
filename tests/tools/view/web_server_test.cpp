#include "view/web_server.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"

#include "http_client.hpp"
#include "view/live_state.hpp"

namespace geoflow::tools {
namespace {

using geoflow::tests::http_get;
using geoflow::tests::HttpAnswer;
using geoflow::tests::RawConnection;
using std::chrono::seconds;
using testing::HasSubstr;

class WebServerTest : public testing::Test {
 protected:
  void start(const WebServerOptions& options = {}) {
    const auto page = std::make_shared<const std::string>("<p>page</p>");
    auto server = WebServer::start(
        options,
        {{.path = "/", .type = "text/html; charset=utf-8", .content = [page] { return page; }},
         {.path = "/map",
          .type = "application/octet-stream",
          .content = []() -> Result<std::shared_ptr<const std::string>> {
            return fail(ErrorCode::kNotFound, "no map yet");
          }}},
        state_);
    ASSERT_TRUE(server) << server.error().message;
    server_.emplace(*std::move(server));
  }
  [[nodiscard]] HttpAnswer get(const std::string& target, const std::string& headers = {}) const {
    return http_get(server_->port(), target, headers);
  }
  void expect_alive() const { EXPECT_EQ(get("/").status, 200); }

  LiveState state_;
  std::optional<WebServer> server_;
};

TEST_F(WebServerTest, ServesThePageAndLetsItDoNothingElse) {
  start();
  const HttpAnswer answer = get("/");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "<p>page</p>");
  EXPECT_THAT(answer.head, HasSubstr("Content-Type: text/html; charset=utf-8"));
  EXPECT_THAT(answer.head, HasSubstr("default-src 'none'; connect-src 'self'"));
  EXPECT_THAT(answer.head, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(answer.head, HasSubstr("X-Content-Type-Options: nosniff"));
  EXPECT_EQ(server_->url(), fmt::format("http://127.0.0.1:{}/", server_->port()));
}

TEST_F(WebServerTest, WhatIsNotThereIsSaid) {
  start();
  EXPECT_EQ(get("/../etc/passwd").status, 404);
  EXPECT_EQ(get("/page").status, 404);
  const HttpAnswer map = get("/map");
  EXPECT_EQ(map.status, 404);
  EXPECT_EQ(map.body, "no map yet");
}

TEST_F(WebServerTest, StreamsEventsUntilItStops) {
  start();
  state_.put("pose", R"({"x":1})");
  RawConnection page{server_->port()};
  page.send(fmt::format("GET /events HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", server_->port()));
  EXPECT_THAT(page.read_until(R"(data: {"x":1})", seconds{10}), HasSubstr("text/event-stream"));
  state_.put("pose", R"({"x":2})");
  EXPECT_THAT(page.read_until(R"(data: {"x":2})", seconds{10}), HasSubstr(R"(data: {"x":2})"));
  server_.reset();
  EXPECT_TRUE(page.closes(seconds{10}));
}

TEST_F(WebServerTest, PagesOfOtherSitesAreRefused) {
  start();
  for (const char* origin : {"http://evil.example", "null", "http://127.0.0.1:1"}) {
    for (const char* target : {"/", "/events", "/map"}) {
      EXPECT_EQ(get(target, fmt::format("Origin: {}\r\n", origin)).status, 403) << origin;
    }
  }
  EXPECT_EQ(get("/", fmt::format("Origin: http://127.0.0.1:{}\r\n", server_->port())).status, 200);
  // DNS rebinding: another site's name that leads here.
  EXPECT_EQ(get("/", fmt::format("Host: evil.example:{}\r\n", server_->port())).status, 403);
  EXPECT_EQ(get("/events", "Host: \r\n").status, 403);
}

TEST_F(WebServerTest, WithoutTheTokenNothingIsShown) {
  start({.token = "0123456789abcdef"});
  for (const char* target : {"/", "/events", "/map", "/?token=", "/?token=0123456789abcdee",
                             "/?token=0123456789abcdef0", "/?tokens=0123456789abcdef"}) {
    EXPECT_EQ(get(target).status, 401) << target;
  }
  EXPECT_EQ(get("/?token=0123456789abcdef").status, 200);
  EXPECT_THAT(server_->url(), HasSubstr("/?token=0123456789abcdef"));
}

TEST_F(WebServerTest, OnlyGetIsAnswered) {
  start();
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "BREW"}) {
    RawConnection client{server_->port()};
    client.send(fmt::format("{} / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: 0\r\n\r\n",
                            method, server_->port()));
    EXPECT_THAT(client.read_until("\r\n\r\n", seconds{10}), HasSubstr("HTTP/1.1 405")) << method;
  }
}

TEST_F(WebServerTest, HugeAndMalformedRequestsEndWithTheirConnection) {
  start();
  const std::vector<std::string> hostile = {
      "GET /" + std::string(1 << 20, 'a') + " HTTP/1.1\r\nHost: x\r\n\r\n",
      "GET / HTTP/1.1\r\nHost: x\r\nX: " + std::string(1 << 20, 'b') + "\r\n\r\n",
      "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999999\r\n\r\n",
      std::string{"\x16\x03\x01\x00\xff\x00\r\n\r\n", 10},
      "\r\n\r\n\r\n",
      "GET  HTTP/9.9\r\n\r\n",
      "GET / HTTP/1.1\r\nHost\r\n\r\n"};
  for (const std::string& bytes : hostile) {
    RawConnection client{server_->port()};
    client.send(bytes);
    client.send("GET / HTTP/1.1\r\n");
    const std::string answer = client.read_until("\r\n", seconds{2});
    EXPECT_THAT(answer, testing::Not(HasSubstr("HTTP/1.1 200"))) << bytes.substr(0, 40);
  }
  expect_alive();
}

TEST_F(WebServerTest, ManyConnectionsDoNotKeepOthersOutForLong) {
  start();
  {
    std::vector<std::unique_ptr<RawConnection>> idle;
    for (int i = 0; i < 40; ++i) {
      idle.push_back(std::make_unique<RawConnection>(server_->port()));
    }
    EXPECT_TRUE(idle.back()->closes(seconds{10})) << "the 33rd and later are closed";
  }
  for (int tries = 0; tries < 50; ++tries) {
    try {
      expect_alive();
      return;
    } catch (const std::runtime_error&) {  // not yet noticed that the others have gone
    }
  }
  FAIL() << "nobody is let in any more";
}

TEST(WebServerStart, SaysWhatIsWrong) {
  LiveState state;
  const auto error = [&](const WebServerOptions& options) {
    const auto server = WebServer::start(options, {}, state);
    return server ? std::string{} : server.error().message;
  };
  EXPECT_THAT(error({.address = "robot"}), HasSubstr("robot: not a numeric IPv4 or IPv6 address"));
  EXPECT_THAT(error({.address = "0.0.0.0"}), HasSubstr("beyond loopback a token is needed"));
  EXPECT_THAT(error({.address = "::"}), HasSubstr("beyond loopback a token is needed"));
  EXPECT_THAT(error({.address = "192.0.2.1", .token = "x"}), HasSubstr("cannot be listened at"));
  LiveState other;
  const auto first = WebServer::start({}, {}, other);
  ASSERT_TRUE(first);
  EXPECT_THAT(error({.port = first->port()}), HasSubstr("is the port taken"));
}

TEST(IsLoopback, KnowsThisMachinesAddresses) {
  EXPECT_TRUE(is_loopback("127.0.0.1"));
  EXPECT_TRUE(is_loopback("127.8.8.8"));
  EXPECT_TRUE(is_loopback("::1"));
  EXPECT_FALSE(is_loopback("0.0.0.0"));
  EXPECT_FALSE(is_loopback("192.168.1.20"));
  EXPECT_FALSE(is_loopback("::"));
  EXPECT_FALSE(is_loopback("localhost"));
}

}  // namespace
}  // namespace geoflow::tools
