#include "geoflow/hal/toml_text.hpp"

#include <initializer_list>
#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"

namespace geoflow {
namespace {

using testing::StartsWith;

TEST(TomlText, LetsPassWhatIsWellFormed) {
  // In two: the escape would take the a for its own.
  constexpr std::string_view kByteOrderMarkAndMore =
      "\xEF\xBB\xBF"
      "a = 1\n";
  for (const std::string_view text : std::initializer_list<std::string_view>{
           "",
           "a = 1\n",
           "[a]\nb = 2.5e-3 # x\n",
           "[[fault]]\nkind = \"gap\"\n",
           "[ a . \"b c\" ]\n",
           "path = \"/home/Jos\xC3\xA9/[ x\"\n",
           "path = 'C:\\[='\n",
           "# \xC3\xA9 [=\na = 1\n",
           kByteOrderMarkAndMore,
           "a = \"\"\"\nx [= \xC3\xA9 \"quoted\" \\\"\"\"\n\"\"\"\n",
           "a = \"\\\"[=\"\n",
           "a = \"\"\n[b]\n",
       }) {
    EXPECT_TRUE(check_toml_text("f", text)) << text;
  }
}

TEST(TomlText, NamesTheLineOfWhatItRefuses) {
  struct Case {
    std::string_view text;
    std::string_view place;
  };
  for (const Case& bad : {
           Case{"[=]\n", "f:1: "},
           Case{"a = 1\n[ .b]\n", "f:2: "},
           Case{"a = 'x'\n\n[[\n", "f:3: "},
           Case{"a = 1\n\xC3\xA9 = 2\n", "f:2: "},
           Case{std::string_view{"a = \0", 5}, "f:1: "},
           Case{"a = 'open\n[=]\n", "f:2: "},
           Case{R"("\\" [,)", "f:1: "},
       }) {
    const auto checked = check_toml_text("f", bad.text);
    ASSERT_FALSE(checked) << bad.text;
    EXPECT_EQ(checked.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(checked.error().message, StartsWith(std::string{bad.place}));
  }
}

TEST(TomlText, TakesAStringWithoutEndForTheWholeRest) {
  EXPECT_TRUE(check_toml_text("f", "a = '''\n[=\n"));
}

}  // namespace
}  // namespace geoflow
