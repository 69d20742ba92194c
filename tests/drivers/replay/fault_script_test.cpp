#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "replay/faults/script.hpp"
#include "replay/fixtures.hpp"

namespace geoflow::drivers {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using tests::message_of;

struct BadScript {
  std::string_view script;
  std::string_view where;
  std::string_view what;
};

class FaultScriptError : public testing::TestWithParam<BadScript> {};

TEST_P(FaultScriptError, NamesFileLineAndKey) {
  EXPECT_THAT(
      message_of(faults::parse_script("f.toml", GetParam().script)),
      AllOf(HasSubstr(std::string{GetParam().where}), HasSubstr(std::string{GetParam().what})));
}

INSTANTIATE_TEST_SUITE_P(
    Scripts, FaultScriptError,
    testing::Values(
        BadScript{"kind = ", "f.toml:1", "not TOML"},
        BadScript{"seed = 1\n", "f.toml:1: seed", "unknown key"},
        BadScript{"[fault]\nkind = 'drop'\n", "f.toml:1: fault", "two brackets"},
        BadScript{"fault = [1]\n", "f.toml:1: fault", "a [[fault]] table"},
        BadScript{"\n[[fault]]\nstream = 'imu'\n", "f.toml:2: kind", "is missing"},
        BadScript{"[[fault]]\nkind = 'drip'\n", "f.toml:2: kind", "'drip' is none of drop, delay"},
        BadScript{"[[fault]]\nkind = 3\n", "f.toml:2: kind", "a word in quotes"},
        BadScript{"[[fault]]\nkind = 'drop'\n", "f.toml:1: stream", "is missing"},
        BadScript{"[[fault]]\nkind = 'drop'\nstream = 'gps'\n", "f.toml:3: stream",
                  "'gps' is none of color"},
        BadScript{"[[fault]]\nkind = 'drop'\nstream = 'imu'\nprobability = 1.5\n",
                  "f.toml:4: probability", "from 0 to 1"},
        BadScript{"[[fault]]\nkind = 'drop'\nstream = 'imu'\nprobability = nan\n",
                  "f.toml:4: probability", "from 0 to 1"},
        BadScript{"[[fault]]\nkind = 'drop'\nstream = 'imu'\nprobability = 'x'\n",
                  "f.toml:4: probability", "a number"},
        BadScript{"[[fault]]\nkind = 'drop'\nstream = 'imu'\nkeep = 0.5\n", "f.toml:4: keep",
                  "is not used by drop"},
        BadScript{"[[fault]]\nkind = 'drop'\nstream = 'imu'\nform_s = 1\n", "f.toml:4: form_s",
                  "unknown key"},
        BadScript{"[[fault]]\nkind = 'gap'\nstream = 'imu'\nfrom_s = 1\n", "f.toml:1: until_s",
                  "gap needs it"},
        BadScript{"[[fault]]\nkind = 'gap'\nstream = 'imu'\nfrom_s = 2\nuntil_s = 2\n",
                  "f.toml:1: until_s", "later than from_s"},
        BadScript{"[[fault]]\nkind = 'delay'\nstream = 'imu'\n", "f.toml:1: delay_s",
                  "delay needs it"},
        BadScript{"[[fault]]\nkind = 'delay'\nstream = 'imu'\ndelay_s = 11\n", "f.toml:4: delay_s",
                  "from 0 to 10"},
        BadScript{"[[fault]]\nkind = 'nan'\nstream = 'depth'\n", "f.toml:3: stream",
                  "nan is for imu"},
        BadScript{"[[fault]]\nkind = 'truncate'\nstream = 'imu'\n", "f.toml:3: stream",
                  "truncate is for images"},
        BadScript{"[[fault]]\nkind = 'cover'\nstream = 'legs'\n", "f.toml:3: stream",
                  "cover is for images"},
        BadScript{"[[fault]]\nkind = 'clock_offset'\nstream = 'color'\noffset_s = 1\n",
                  "f.toml:3: stream", "the clocks are"},
        BadScript{"[[fault]]\nkind = 'clock_wrap'\nstream = 'imu'\nfirst_wrap_s = 5000\n",
                  "f.toml:4: first_wrap_s", "4294.967"}));

TEST(FaultScript, RefusesWhatItsParserWouldTripOver) {
  for (const char* header : {"[", "[[", "[\x05", "[!]", "[[ !", "[\n", "[[[a]]]", "[]",
                             "k_i\xcb\x8c", "[\xc2\xa0!", "a\f[!"}) {
    EXPECT_THAT(message_of(faults::parse_script("f", std::string{"# [!] is a comment\n"} + header)),
                HasSubstr("f:2: not TOML"))
        << header;
  }
  EXPECT_TRUE(faults::parse_script(
      "f", "# [!] is a comment\n[[ fault ]]\nkind = 'drop'\nstream = 'imu'\n"));
}

TEST(FaultScript, AllowsAtMost64Faults) {
  std::string script;
  for (int i = 0; i < 65; ++i) {
    script += "[[fault]]\nkind = 'drop'\nstream = 'imu'\n";
  }
  EXPECT_THAT(message_of(faults::parse_script("f", script)), HasSubstr("f:193: fault: at most 64"));
}

}  // namespace
}  // namespace geoflow::drivers
