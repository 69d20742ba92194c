#include "view/live_state.hpp"

#include <chrono>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::Not;

/// The data of the event of that name in a text of events; null where it has none.
nlohmann::json data_of(const std::string& text, const std::string& event) {
  const std::string head = "event: " + event + "\ndata: ";
  const auto begin = text.find(head);
  if (begin == std::string::npos) {
    return {};
  }
  const auto from = begin + head.size();
  return nlohmann::json::parse(text.substr(from, text.find('\n', from) - from));
}

TEST(LiveState, TellsEachPageTheNewestOnce) {
  LiveState state;
  state.put("pose", "1");
  state.put("pose", "2");
  state.put("status", "{}");
  PageProgress page;
  const std::string first = state.next(page, seconds{10});
  EXPECT_EQ(data_of(first, "pose"), 2);
  EXPECT_THAT(first, HasSubstr("event: status\n"));
  EXPECT_EQ(state.next(page, milliseconds{1}), ": nothing new\n\n");
  state.put("pose", "3");
  const std::string second = state.next(page, seconds{10});
  EXPECT_EQ(second, "event: pose\ndata: 3\n\n");
  PageProgress late;
  EXPECT_EQ(data_of(state.next(late, seconds{10}), "pose"), 3);
}

TEST(LiveState, WakesWhoWaits) {
  LiveState state;
  PageProgress page;
  (void)state.next(page, seconds{0});
  std::jthread putting{[&] { state.put("pose", "1"); }};
  EXPECT_EQ(data_of(state.next(page, seconds{10}), "pose"), 1);
}

TEST(LiveState, GivesALatePageTheWaySoFar) {
  LiveState state;
  for (int i = 0; i < 10; ++i) {
    state.add_to_way({0.015 * i, 0, 0});
  }
  PageProgress page;
  const nlohmann::json way = data_of(state.next(page, seconds{10}), "way");
  ASSERT_EQ(way.size(), 5U) << "points 2 cm apart: " << way;
  EXPECT_EQ(way.back().at(0), 0.12);
  state.add_to_way({1, 0, 0});
  EXPECT_THAT(state.next(page, milliseconds{1}), Not(HasSubstr("event: way")))
      << "a page that was there adds the poses itself";
  state.clear_way();
  EXPECT_EQ(data_of(state.next(page, seconds{10}), "way"), nlohmann::json::array());
}

TEST(LiveState, AWayOfAnyLengthStaysSmall) {
  LiveState state;
  for (int i = 0; i < 100'000; ++i) {
    state.add_to_way({0.1 * i, 0, 0});
  }
  PageProgress page;
  const nlohmann::json way = data_of(state.next(page, seconds{10}), "way");
  EXPECT_LE(way.size(), 20'000U);
  EXPECT_GE(way.size(), 10'000U);
  EXPECT_EQ(way.front().at(0), 0.0);
  EXPECT_NEAR(way.back().at(0).get<double>(), 9999.9, 1e-6);
}

TEST(LiveState, ClosedItHoldsNobody) {
  LiveState state;
  PageProgress page;
  (void)state.next(page, seconds{0});
  std::jthread closing{[&] { state.close(); }};
  EXPECT_EQ(state.next(page, seconds{60}), "");
}

}  // namespace
}  // namespace geoflow::tools
