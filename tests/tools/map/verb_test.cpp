#include "geoflow/tools/verb.hpp"

#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/slam/saved_map.hpp"

#include "slam/storage/small_map.hpp"
#include "tools/verb_fixture.hpp"

namespace geoflow::tools {

// NOLINTNEXTLINE(misc-use-internal-linkage): the verb's library defines it
std::unique_ptr<Verb> make_map_verb();

namespace {

using slam::tests::read_bytes;
using slam::tests::write_bytes;
using testing::HasSubstr;
using testing::StartsWith;

class MapVerbTest : public tests::VerbTest {
 protected:
  MapVerbTest() : VerbTest{make_map_verb} {
    EXPECT_TRUE(slam::save_map(slam::tests::small_map("small"), file("small.map")));
  }
};

TEST_F(MapVerbTest, InfoCountsWhatThereIs) {
  ASSERT_EQ(run({"info", file("small.map"), "--json"}), 0) << err_;
  const auto info = nlohmann::json::parse(out_);
  EXPECT_EQ(info["keyframes"], 3);
  EXPECT_EQ(info["with_depth"], 3);
  EXPECT_EQ(info["points"], 2);
  EXPECT_EQ(info["parts"], 1);
  EXPECT_EQ(info["calibration"]["serial"], "0123");
}

TEST_F(MapVerbTest, InfoNamesTheByteThatIsDamaged) {
  std::string bytes = read_bytes(file("small.map"));
  bytes[bytes.size() / 2] ^= 1;
  write_bytes(file("small.map"), bytes);
  EXPECT_EQ(run({"info", file("small.map")}), 3);
  EXPECT_THAT(err_, HasSubstr("small.map"));
  EXPECT_THAT(err_, HasSubstr("checksum"));
}

TEST_F(MapVerbTest, ExportsPointsAndSurfacesByTheFilesExtension) {
  ASSERT_EQ(run({"export", file("small.map"), "--points", file("p.ply"), "--planes", file("s.pcd"),
                 "--keyframes", file("k.txt")}),
            0)
      << err_;
  const std::string ply = read_bytes(file("p.ply"));
  EXPECT_THAT(ply, StartsWith("ply\nformat ascii 1.0\n"));
  EXPECT_THAT(ply, HasSubstr("element vertex 2\n"));
  EXPECT_THAT(ply, HasSubstr("end_header\n1.0000 2.0000 3.1416\n"));
  const std::string pcd = read_bytes(file("s.pcd"));
  EXPECT_THAT(pcd, HasSubstr("FIELDS x y z normal_x normal_y normal_z sigma\n"
                             "SIZE 4 4 4 4 4 4 4\nTYPE F F F F F F F\nCOUNT 1 1 1 1 1 1 1\n"));
  // Six surfels, of which the third keyframe's two lie where the first one's do.
  EXPECT_THAT(pcd, HasSubstr("\nPOINTS 4\nDATA ascii\n"));
  EXPECT_THAT(read_bytes(file("k.txt")), HasSubstr("1.002"));
}

TEST_F(MapVerbTest, RefusesToExportNothingOrToAnUnknownFormat) {
  EXPECT_EQ(run({"export", file("small.map")}), 2);
  EXPECT_THAT(err_, HasSubstr("nothing to export"));
  EXPECT_EQ(run({"export", file("small.map"), "--points", file("p.xyz")}), 2);
  EXPECT_THAT(err_, HasSubstr("p.xyz: points are written as .ply or .pcd"));
  EXPECT_FALSE(std::filesystem::exists(file("p.xyz")));
}

}  // namespace
}  // namespace geoflow::tools
