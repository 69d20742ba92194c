#include "geoflow/daemon/config.hpp"

#include <cctype>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

namespace geoflow::daemon {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

std::string error_of(std::string_view text) {
  const auto config = parse_config(text, "test.toml");
  EXPECT_FALSE(config) << text;
  return config ? std::string{} : config.error().message;
}

std::string read_shipped() {
  const std::ifstream file{GEOFLOW_SHIPPED_CONFIG};
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Config, TheShippedFileHoldsEveryKeyWithItsDefault) {
  const auto shipped = load_config(GEOFLOW_SHIPPED_CONFIG);
  ASSERT_TRUE(shipped) << shipped.error().message;
  const std::vector<ConfigValue> defaults = list_keys(Config{});
  const std::vector<ConfigValue> values = list_keys(*shipped);
  ASSERT_EQ(values.size(), defaults.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(values[i].value, defaults[i].value) << values[i].key;
  }
  EXPECT_GT(values.size(), 40U);
}

TEST(Config, TheShippedFileDocumentsEveryKeyAndEveryNumbersUnit) {
  std::istringstream lines{read_shipped()};
  std::string comment;
  std::string section;
  std::vector<std::string> documented;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) {
      comment = line;
    } else if (line.starts_with("[")) {
      section = line.substr(1, line.find(']') - 1);
      comment.clear();
    } else if (const std::size_t equals = line.find(" = "); equals != std::string::npos) {
      const std::string key = section + "." + line.substr(0, equals);
      EXPECT_FALSE(comment.empty()) << key << " has no comment";
      if (std::isdigit(static_cast<unsigned char>(line.at(equals + 3))) != 0) {
        EXPECT_THAT(comment, AllOf(HasSubstr("["), HasSubstr("]"))) << key << " has no unit";
      }
      documented.push_back(key);
      comment.clear();
    }
  }
  std::vector<std::string> known;
  for (const auto& [key, value] : list_keys(Config{})) {
    known.push_back(key);
  }
  EXPECT_THAT(documented, testing::UnorderedElementsAreArray(known));
}

TEST(Config, ValuesAreSet) {
  const auto config = parse_config(R"(
source.replay = "bag"
[slam]
switches.gicp = false
keyframes = { maximum_interval_s = 1.5, translation_m = 1 }
[socket]
mode = 0o600
)",
                                   "test.toml");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->source.replay, "bag");
  EXPECT_FALSE(config->slam.switches.gicp);
  EXPECT_EQ(config->slam.keyframes.maximum_interval, std::chrono::milliseconds{1500});
  EXPECT_EQ(config->slam.keyframes.translation_m, 1.0);
  EXPECT_EQ(config->socket.mode, 0600);
}

TEST(Config, ErrorsNameFileLineAndKey) {
  EXPECT_THAT(error_of("\n[slam.pose]\nitterations = 3\n"),
              AllOf(StartsWith("test.toml:3: slam.pose.itterations: unknown key"),
                    HasSubstr("slam.pose.iterations")));
  EXPECT_THAT(error_of("[nonsense]\na.b = 1\n"),
              StartsWith("test.toml:2: nonsense.a.b: unknown key"));
  EXPECT_THAT(error_of("[slam.pose]\n\n\niterations = 0\n"),
              AllOf(StartsWith("test.toml:4: slam.pose.iterations: 0"), HasSubstr("1 to 100")));
  EXPECT_THAT(error_of("slam.pose.iterations = 3.5\n"), HasSubstr("must be a whole number"));
  EXPECT_THAT(error_of("slam.switches.gicp = \"no\"\n"), HasSubstr("must be true or false"));
  EXPECT_THAT(error_of("topics.color = 1\n"), HasSubstr("must be a string"));
  EXPECT_THAT(error_of("slam.pose.pixel_sigma = nan\n"), HasSubstr("out of range"));
  EXPECT_THAT(error_of("slam.pose.pixel_sigma = inf\n"), HasSubstr("out of range"));
  EXPECT_THAT(error_of("slam.pose = 3\n"), HasSubstr("section"));
  EXPECT_THAT(error_of("a = 1\na = 2\n"), StartsWith("test.toml:2:"));
  EXPECT_THAT(error_of("a = [\n"), StartsWith("test.toml:"));
  EXPECT_EQ(parse_config("a = 1", "x").error().code, ErrorCode::kInvalidArgument);
}

TEST(Config, AMissingOrHugeFileIsAnError) {
  EXPECT_EQ(load_config("/nonexistent/geoflow.toml").error().code, ErrorCode::kNotFound);
  const tests::TemporaryDirectory directory;
  EXPECT_FALSE(load_config(directory.path()));
  const auto huge = directory.path() / "huge.toml";
  std::ofstream{huge} << std::string(std::size_t{2} << 20U, '#');
  EXPECT_THAT(load_config(huge).error().message, HasSubstr("not a configuration"));
}

TEST(Config, SetKeyTakesTomlValuesAndBareWords) {
  Config config;
  ASSERT_TRUE(set_key(config, "slam.switches.gicp=false"));
  EXPECT_FALSE(config.slam.switches.gicp);
  ASSERT_TRUE(set_key(config, "source.replay=/a/b c"));
  EXPECT_EQ(config.source.replay, "/a/b c");
  ASSERT_TRUE(set_key(config, "socket.handshake_timeout_s=0.25"));
  EXPECT_EQ(config.socket.handshake_timeout, std::chrono::milliseconds{250});
  EXPECT_THAT(set_key(config, "slam.switches.gicpp=false").error().message,
              HasSubstr("slam.switches.gicp"));
  EXPECT_FALSE(set_key(config, "slam.switches.gicp"));
  EXPECT_FALSE(set_key(config, "=1"));
  EXPECT_FALSE(set_key(config, "slam.pose.iterations=1e9"));
}

}  // namespace
}  // namespace geoflow::daemon
