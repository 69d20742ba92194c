#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "tests/support/data.hpp"

#include "slam/storage/small_map.hpp"
#include "storage/stored_map.hpp"

namespace geoflow::slam {
namespace {

using geoflow::tests::TemporaryDirectory;
using tests::small_map;

class KilledSaveTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(save_map(old_, path_)); }

  /// Runs `body` in a child process that ends by itself or by its death.
  template <typename Body>
  [[nodiscard]] static pid_t in_child(const Body& body) {
    const pid_t child = ::fork();
    if (child == 0) {
      ::_exit(body());
    }
    return child;
  }

  /// What the file's identity says; empty, and a failed assertion, where it cannot be loaded.
  [[nodiscard]] std::string loaded() const {
    const auto map = load_map(path_);
    EXPECT_TRUE(map) << map.error().message;
    if (!map) {
      return {};
    }
    const auto intact = check_depth(**map);
    EXPECT_TRUE(intact) << intact.error().message;
    return summary(**map).calibration.source;
  }

  StoredMap old_ = small_map("old");
  StoredMap new_ = small_map("new");
  TemporaryDirectory folder_;
  std::filesystem::path path_ = folder_.path() / "test.map";
};

TEST_F(KilledSaveTest, AtAnyMomentTheOldMapOrTheNewOneIsThere) {
  constexpr int kKills = 100;
  constexpr int kLongestUs = 20000;
  const std::uint64_t seed = geoflow::tests::test_seed(51);
  std::mt19937_64 random{seed};
  std::uniform_int_distribution<useconds_t> moment{0, kLongestUs};
  int old_found = 0;
  for (int i = 0; i < kKills; ++i) {
    const pid_t child = in_child([&] {
      for (bool turn = true;; turn = !turn) {
        if (!save_map(turn ? new_ : old_, path_)) {
          return EXIT_FAILURE;
        }
      }
    });
    ASSERT_GT(child, 0);
    ::usleep(moment(random));
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "it was still saving; seed " << seed;
    const std::string found = loaded();
    ASSERT_THAT(found, testing::AnyOf("old", "new"));
    old_found += found == "old" ? 1 : 0;
  }
  EXPECT_GT(old_found, 0);
  EXPECT_LT(old_found, kKills);
}

TEST_F(KilledSaveTest, AFullDiskLeavesTheOldMap) {
  const auto size = static_cast<rlim_t>(std::filesystem::file_size(path_));
  for (rlim_t room = 0; room < size; room += size / 50) {
    const pid_t child = in_child([&] {
      const rlimit limit{.rlim_cur = room, .rlim_max = room};
      ::signal(SIGXFSZ, SIG_IGN);
      ::setrlimit(RLIMIT_FSIZE, &limit);
      const auto saved = save_map(new_, path_);
      return !saved && saved.error().code == ErrorCode::kSystem ? EXIT_SUCCESS : EXIT_FAILURE;
    });
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS) << room;
    EXPECT_EQ(loaded(), "old") << room;
    EXPECT_FALSE(std::filesystem::exists(path_.string() + ".tmp")) << room;
  }
}

}  // namespace
}  // namespace geoflow::slam
