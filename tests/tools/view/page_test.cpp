#include <string>

#include <gtest/gtest.h>

#include "tests/support/data.hpp"

#include "process.hpp"
#include "synthetic_recording.hpp"

namespace geoflow::tools {
namespace {

TEST(ViewPage, ShowsADaemonInABrowser) {
  const geoflow::tests::TemporaryDirectory folder;
  const auto recording = folder.path() / "recording";
  geoflow::tests::write_synthetic_recording(recording, {.frames = 300});
  const geoflow::tests::Finished finished = geoflow::tests::run_process(
      {"/usr/bin/python3", PAGE_TEST, "--geoflow", GEOFLOW_PROGRAM, "--geoflowd", GEOFLOWD_PROGRAM,
       "--recording", recording.string()},
      folder.path() / "page");
  constexpr int kSkipped = 77;
  if (finished.code == kSkipped) {
    GTEST_SKIP() << finished.out;
  }
  EXPECT_EQ(finished.code, 0) << finished.out << finished.err;
}

}  // namespace
}  // namespace geoflow::tools
