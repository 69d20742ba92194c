#include "geoflow/tools/page.hpp"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace geoflow::tools {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(FillPage, PutsEachPartInItsPlacesAndReadsNoneOfThem) {
  EXPECT_EQ(fill_page("a {{x}} b {{y}} c {{x}}", {{"x", "{{y}}"}, {"y", "2"}}),
            "a {{y}} b 2 c {{y}}");
}

TEST(FillPage, LeavesWhatHasNoPart) {
  EXPECT_EQ(fill_page("{{x}} {{other}} {{open", {{"x", "1"}}), "1 {{other}} {{open");
  EXPECT_EQ(fill_page("", {}), "");
}

TEST(JsonForPage, CannotEndTheElementItStandsIn) {
  const nlohmann::json value{{"name", "</script><!--<b>"}};
  const std::string text = json_for_page(value);
  EXPECT_THAT(text, Not(HasSubstr("<")));
  EXPECT_EQ(nlohmann::json::parse(text), value);
}

TEST(JsonForPage, SurvivesBytesThatAreNoText) {
  const std::string text = json_for_page({{"name", "a\xff"}});
  EXPECT_EQ(nlohmann::json::parse(text).at("name"), "a\xef\xbf\xbd");
}

TEST(PageAssets, NeedNoNetwork) {
  for (const std::string_view asset : {page_styles(), plot_script()}) {
    EXPECT_FALSE(asset.empty());
    EXPECT_EQ(asset.find("http"), std::string_view::npos);
    EXPECT_EQ(asset.find("@import"), std::string_view::npos);
    EXPECT_EQ(asset.find("innerHTML"), std::string_view::npos);
  }
}

}  // namespace
}  // namespace geoflow::tools
