#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/data.hpp"

#include "process.hpp"
#include "simulated_walk.hpp"

/// A walk with all sensors, twice: where a program's memory lies is another time another place.
namespace geoflow::daemon {
namespace {

std::string read_text(const std::filesystem::path& path) {
  std::ifstream file{path};
  return {std::istreambuf_iterator<char>{file}, {}};
}

TEST(SameWalk, TwoReplaysAreEqualToTheByte) {
  constexpr int kDurationS = 10;
  constexpr std::size_t kLeastText = 10'000;
  const tests::TemporaryDirectory directory;
  const auto bag = tests::simulate_walk(directory.path(), "office", 4, kDurationS);
  ASSERT_FALSE(bag.empty());
  for (const char* name : {"a", "b"}) {
    const auto run = tests::run_process(
        {GEOFLOW_PROGRAM, "replay", bag.string(), "-o", (directory.path() / name).string()},
        directory.path() / "log");
    ASSERT_EQ(run.code, 0) << run.err;
  }
  for (const char* name : {"live_base.txt", "final_base.txt", "estimates.csv"}) {
    const std::string text = read_text(directory.path() / "a" / name);
    EXPECT_GT(text.size(), kLeastText) << name;
    EXPECT_EQ(text, read_text(directory.path() / "b" / name)) << name;
  }
}

}  // namespace
}  // namespace geoflow::daemon
