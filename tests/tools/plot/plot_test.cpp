#include "geoflow/tools/plot.hpp"

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

#include "plot/src/scale.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::vector<std::string> labels(const Range& range, int count) {
  std::vector<std::string> result;
  for (const Tick& tick : ticks(range, count)) {
    result.push_back(tick.label);
  }
  return result;
}

std::string content(const std::filesystem::path& path) {
  std::ifstream stream{path, std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

Figure figure_of(std::vector<double> x, std::vector<double> y) {
  Axes axes{.title = "title", .x_label = "x (m)", .y_label = "y (m)", .equal_aspect = true};
  axes.series.push_back({.label = "line", .x = std::move(x), .y = std::move(y)});
  Figure figure{.title = "figure"};
  figure.axes.push_back(axes);
  return figure;
}

TEST(Ticks, AreRoundAndWithinTheRange) {
  EXPECT_THAT(labels({.low = 0, .high = 1}, 5),
              testing::ElementsAre("0.0", "0.2", "0.4", "0.6", "0.8", "1.0"));
  EXPECT_THAT(labels({.low = -3, .high = 7}, 2), testing::ElementsAre("0", "5"));
  EXPECT_THAT(labels({.low = 0.011, .high = 0.034}, 4), testing::ElementsAre("0.02", "0.03"));
  EXPECT_THAT(labels({.low = 2e6, .high = 4e6}, 2),
              testing::ElementsAre("2e+06", "3e+06", "4e+06"));
}

TEST(Ticks, OfLogarithmsArePowersOfTen) {
  std::vector<std::string> found;
  for (const Tick& tick : decade_ticks({.low = -4.2, .high = -0.9})) {
    found.push_back(tick.label);
  }
  EXPECT_THAT(found, testing::ElementsAre("1e-4", "1e-3", "1e-2", "1e-1"));
  found.clear();
  for (const Tick& tick : decade_ticks({.low = 0.2, .high = 1.1})) {
    found.push_back(tick.label);
  }
  EXPECT_THAT(found, testing::ElementsAre("2e0", "5e0", "1e1"));
}

TEST(RangeFinder, IsNeverEmptyAndLeavesOutWhatCannotBeDrawn) {
  RangeFinder none;
  none.add(std::numeric_limits<double>::quiet_NaN());
  none.add(std::numeric_limits<double>::infinity());
  none.add(1e300);
  EXPECT_GT(none.range().span(), 0);
  RangeFinder one;
  one.add(-4);
  EXPECT_LT(one.range().low, -4);
  EXPECT_GT(one.range().high, -4);
}

TEST(SaveFigure, WritesPngAndSvg) {
  const tests::TemporaryDirectory folder;
  const Figure figure = figure_of({0, 1, 2}, {0, 1, 0});
  for (const char* name : {"a.png", "b.png", "a.svg"}) {
    ASSERT_TRUE(save_figure(figure, folder.path() / name));
  }
  EXPECT_THAT(content(folder.path() / "a.png"), StartsWith("\x89PNG"));
  EXPECT_THAT(content(folder.path() / "a.svg"), HasSubstr("<svg"));
  EXPECT_EQ(content(folder.path() / "a.png"), content(folder.path() / "b.png"));
}

TEST(SaveFigure, DrawsAwkwardData) {
  const tests::TemporaryDirectory folder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(save_figure(Figure{}, folder.path() / "a.png"));
  EXPECT_TRUE(save_figure(figure_of({}, {}), folder.path() / "a.png"));
  EXPECT_TRUE(save_figure(figure_of({5}, {5}), folder.path() / "a.png"));
  EXPECT_TRUE(save_figure(figure_of({nan, 1, 2, 1e300}, {0, nan, 1, 0}), folder.path() / "a.png"));
  Figure colored = figure_of({0, 1, 2}, {0, 1e-9, 0});
  colored.axes[0].series[0].values = {1, nan, 1};
  EXPECT_TRUE(save_figure(colored, folder.path() / "a.png"));
}

TEST(SaveFigure, SaysWhatIsWrong) {
  const tests::TemporaryDirectory folder;
  const Figure figure = figure_of({0, 1}, {0, 1});
  const auto message = [&](const Figure& f, const char* name) {
    const auto saved = save_figure(f, folder.path() / name);
    return saved ? std::string{"no error"} : saved.error().message;
  };
  EXPECT_THAT(message(figure, "a.jpeg"), HasSubstr("must end with .png or .svg"));
  EXPECT_THAT(message(figure, "none/a.png"), HasSubstr("none/a.png"));
  EXPECT_THAT(message(figure, "none/a.svg"), HasSubstr("none/a.svg"));
  EXPECT_THAT(message(figure_of({0, 1}, {0}), "a.png"), HasSubstr("2 x, 1 y"));
  Figure huge = figure;
  huge.width_px = 1'000'000;
  EXPECT_THAT(message(huge, "a.png"), HasSubstr("1000000 x 1050 px"));
}

TEST(FigureJson, HasWhatAScriptDrawsFrom) {
  Figure figure = figure_of({0, 1, 2}, {1.23456789, std::numeric_limits<double>::quiet_NaN(), 3});
  figure.axes[0].series[0].values = {0, 0.5, 1};
  const nlohmann::json json = to_json(figure);
  EXPECT_EQ(json.at("columns"), 2);
  const nlohmann::json& axes = json.at("axes").at(0);
  EXPECT_EQ(axes.at("title"), "title");
  EXPECT_EQ(axes.at("equal"), true);
  const nlohmann::json& series = axes.at("series").at(0);
  EXPECT_EQ(series.at("x"), nlohmann::json::parse("[0, 1, 2]"));
  EXPECT_EQ(series.at("y"), nlohmann::json::parse("[1.23457, null, 3]"));
  EXPECT_EQ(series.at("values"), nlohmann::json::parse("[0, 0.5, 1]"));
  EXPECT_EQ(series.at("color").size(), 3U);
}

TEST(FigureJson, OfALongSeriesKeepsWhatIsSeen) {
  constexpr std::size_t kPoints = 200'000;
  constexpr std::size_t kSpike = 123'457;
  std::vector<double> x(kPoints);
  std::vector<double> y(kPoints, 0.0);
  std::iota(x.begin(), x.end(), 0.0);
  y[kSpike] = 1;
  y[kSpike + 1] = -2;
  y[kSpike + 2] = std::numeric_limits<double>::infinity();
  const nlohmann::json series = to_json(figure_of(x, y)).at("axes").at(0).at("series").at(0);
  const auto kept = series.at("y").get<std::vector<nlohmann::json>>();
  EXPECT_LE(kept.size(), 7000U);
  EXPECT_EQ(kept.size(), series.at("x").size());
  EXPECT_THAT(kept, testing::Contains(1));
  EXPECT_THAT(kept, testing::Contains(-2));
  EXPECT_THAT(kept, testing::Contains(nlohmann::json{}));
  EXPECT_EQ(series.at("x").front(), 0);
  EXPECT_EQ(series.at("x").back(), kPoints - 1);
}

TEST(FigureJson, ColorsGoFromDarkToLight) {
  const nlohmann::json colors = color_map_json();
  ASSERT_GE(colors.size(), 16U);
  EXPECT_LT(colors.front().at(0), colors.back().at(0));
}

}  // namespace
}  // namespace geoflow::tools
