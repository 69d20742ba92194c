#include "geoflow/tools/simulator/knob.hpp"

#include <array>
#include <span>
#include <string_view>

#include <gtest/gtest.h>

namespace geoflow::simulator {
namespace {

struct Options {
  double length_m = 1.5;
  int count = 3;
  bool lit = true;
};

constexpr std::array<Knob<Options>, 3> kTable{{
    {"room.length_m", "m", "how long", &Options::length_m, 0.5, 10},
    {"room.count", "", "how many", &Options::count, 0, 5},
    {"room.lit", "", "whether", &Options::lit, 0, 1},
}};

TEST(Knob, DescribesItsDefaultAndKind) {
  const KnobInfo length = describe(kTable[0]);
  EXPECT_EQ(length.fallback, 1.5);
  EXPECT_FALSE(length.whole);
  EXPECT_EQ(describe(kTable[1]).fallback, 3);
  EXPECT_TRUE(describe(kTable[2]).whole);
}

TEST(Knob, SetsTheMemberThatItNames) {
  Options options;
  const std::span<const Knob<Options>> table{kTable};
  EXPECT_TRUE(set_knob(table, "room.length_m", "2.25", options).value());
  EXPECT_TRUE(set_knob(table, "room.count", "5", options).value());
  EXPECT_TRUE(set_knob(table, "room.lit", "0", options).value());
  EXPECT_EQ(options.length_m, 2.25);
  EXPECT_EQ(options.count, 5);
  EXPECT_FALSE(options.lit);
  EXPECT_FALSE(set_knob(table, "room.width_m", "2", options).value());
}

TEST(Knob, RefusesWhatIsNoNumberNoWholeNumberOrOutOfRange) {
  Options options;
  const std::span<const Knob<Options>> table{kTable};
  for (const std::string_view text : {"", "long", "2x", "nan", "inf", "0.4", "11", " 2"}) {
    const auto set = set_knob(table, "room.length_m", text, options);
    ASSERT_FALSE(set) << text;
    EXPECT_NE(set.error().message.find("room.length_m"), std::string_view::npos);
  }
  EXPECT_FALSE(set_knob(table, "room.count", "2.5", options));
  EXPECT_FALSE(set_knob(table, "room.lit", "2", options));
  EXPECT_EQ(options.length_m, 1.5);
}

}  // namespace
}  // namespace geoflow::simulator
