#include "geoflow/tools/trajectory_file.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using std::chrono::nanoseconds;
using testing::HasSubstr;

std::string parse_error(std::string_view text,
                        std::optional<TrajectoryFormat> format = std::nullopt) {
  const auto parsed = parse_trajectory(text, "poses.txt", format);
  return parsed ? "no error" : parsed.error().message;
}

TEST(DecimalSeconds, AreReadToTheNanosecond) {
  EXPECT_EQ(parse_decimal_seconds("1305031102.160407"), nanoseconds{1305031102160407000});
  EXPECT_EQ(parse_decimal_seconds("1403715524.907143168"), nanoseconds{1403715524907143168});
  EXPECT_EQ(parse_decimal_seconds("1.403715524907143168e+09"), nanoseconds{1403715524907143168});
  EXPECT_EQ(parse_decimal_seconds("12e-3"), nanoseconds{12'000'000});
  EXPECT_EQ(parse_decimal_seconds("-0.5"), nanoseconds{-500'000'000});
  EXPECT_EQ(parse_decimal_seconds("7"), nanoseconds{7'000'000'000});
  EXPECT_EQ(parse_decimal_seconds("7."), nanoseconds{7'000'000'000});
  EXPECT_EQ(parse_decimal_seconds(".25"), nanoseconds{250'000'000});
}

TEST(DecimalSeconds, RoundBelowTheNanosecond) {
  EXPECT_EQ(parse_decimal_seconds("0.0000000015"), nanoseconds{2});
  EXPECT_EQ(parse_decimal_seconds("0.0000000014999"), nanoseconds{1});
  EXPECT_EQ(parse_decimal_seconds("5e-10"), nanoseconds{1});
  EXPECT_EQ(parse_decimal_seconds("1e-30"), nanoseconds{0});
}

TEST(DecimalSeconds, RefuseWhatIsNoNumberOrTooLarge) {
  for (const char* text : {"", ".", "-", "e5", "1e", "1e5x", "nan", "inf", "0x10", "1,5", "1 2",
                           "1e99", "1e-99", "9223372037", "99999999999999999999"}) {
    EXPECT_EQ(parse_decimal_seconds(text), std::nullopt) << text;
  }
  EXPECT_EQ(parse_decimal_seconds("9223372036.854775807"), nanoseconds{9223372036854775807});
}

TEST(ParseTrajectory, ReadsTumAndSkipsCommentsBlankLinesAndCarriageReturns) {
  const auto file = parse_trajectory(
      "\xEF\xBB\xBF# time x y z\r\n\r\n1.5 1 2 3 0 0 0 1\r\n  2.5\t-1 2e0 +3 0 0 0.7071068 "
      "0.7071068",
      "a");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->format, TrajectoryFormat::kTum);
  ASSERT_EQ(file->poses.size(), 2U);
  EXPECT_TRUE(file->warnings.empty());
  EXPECT_EQ(file->poses[1].t, HostTime{nanoseconds{2'500'000'000}});
  EXPECT_TRUE(file->poses[1].pose.translation().isApprox(Vector3d{-1, 2, 3}));
  EXPECT_TRUE(
      (file->poses[1].pose.rotation() * Vector3d::UnitX()).isApprox(Vector3d::UnitY(), 1e-6));
}

TEST(ParseTrajectory, ReadsKittiWithTheLineNumberAsTime) {
  const auto file = parse_trajectory("1 0 0 4 0 1 0 5 0 0 1 6\n0 -1 0 7 1 0 0 8 0 0 1 9\n", "a");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->format, TrajectoryFormat::kKitti);
  ASSERT_EQ(file->poses.size(), 2U);
  EXPECT_EQ(file->poses[0].t.time_since_epoch(), nanoseconds{0});
  EXPECT_EQ(file->poses[1].t.time_since_epoch(), std::chrono::seconds{1});
  EXPECT_TRUE(file->poses[1].pose.translation().isApprox(Vector3d{7, 8, 9}));
  EXPECT_TRUE((file->poses[1].pose.rotation() * Vector3d::UnitX()).isApprox(Vector3d::UnitY()));
}

TEST(ParseTrajectory, ReadsEurocWithItsQuaternionOrder) {
  const auto file = parse_trajectory(
      "#timestamp, p_x\n1403715524907143168,1,2,3,0.7071068,0,0,0.7071068,9,9,9\n", "a");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->format, TrajectoryFormat::kEuroc);
  EXPECT_EQ(file->poses[0].t.time_since_epoch(), nanoseconds{1403715524907143168});
  EXPECT_TRUE(
      (file->poses[0].pose.rotation() * Vector3d::UnitX()).isApprox(Vector3d::UnitY(), 1e-6));
}

TEST(ParseTrajectory, SortsAndDropsRepeatedTimesWithAWarning) {
  const auto file = parse_trajectory(
      "3 3 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n3 9 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n", "shuffled.txt");
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->poses.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(file->poses[i].pose.translation().x(), static_cast<double>(i + 1));
  }
  EXPECT_THAT(file->warnings,
              testing::ElementsAre(HasSubstr("shuffled.txt: the poses are not in order"),
                                   HasSubstr("1 poses repeat the time")));
}

TEST(ParseTrajectory, NamesFileAndLineOfWhatIsWrong) {
  const std::string good = "# head\n1 0 0 0 0 0 0 1\n";
  EXPECT_THAT(
      parse_error(good + "2 0 0 0 0 0 1\n"),
      HasSubstr("poses.txt:3: expected 8 numbers (timestamp tx ty tz qx qy qz qw), found 7"));
  EXPECT_THAT(parse_error(good + "2 0 zero 0 0 0 0 1\n"),
              HasSubstr("poses.txt:3: column 3: 'zero' is not a number"));
  EXPECT_THAT(parse_error(good + "2 0 0 nan 0 0 0 1\n"),
              HasSubstr("poses.txt:3: column 4: 'nan' is not a finite number"));
  EXPECT_THAT(parse_error(good + "2 0 0 1e999 0 0 0 1\n"),
              HasSubstr("poses.txt:3: column 4: '1e999'"));
  EXPECT_THAT(parse_error(good + "nan 0 0 0 0 0 0 1\n"),
              HasSubstr("poses.txt:3: column 1: 'nan' is not a time in seconds"));
  EXPECT_THAT(parse_error(good + "2 0 0 0 0 0 0 0\n"),
              HasSubstr("poses.txt:3: the quaternion's norm is 0 instead of 1"));
  EXPECT_THAT(parse_error(good + "2 0 0 0 0 0 0 1.02\n"), HasSubstr("norm is 1.02 instead of 1"));
  EXPECT_THAT(parse_error("1 0 0 0 0 1 0 0 0 0 -1 0\n"),
              HasSubstr("poses.txt:1: the left 3 x 3 part is no rotation"));
  EXPECT_THAT(parse_error("2 0 0 0 0 1 0 0 0 0 1 0\n"), HasSubstr("is no rotation"));
  EXPECT_THAT(parse_error("1,2,3\n"), HasSubstr("poses.txt:1: expected at least 8 values"));
  EXPECT_THAT(parse_error("1.5,0,0,0,1,0,0,0\n"),
              HasSubstr("'1.5' is not a time in integer nanoseconds"));
  EXPECT_THAT(parse_error("PNG garbage\n"),
              HasSubstr("poses.txt:1: 'PNG garbage' is no trajectory"));
  EXPECT_THAT(parse_error("# only\n# comments"), HasSubstr("poses.txt: holds no pose"));
  EXPECT_THAT(parse_error("1 0 0 0 0 0 0 1\n", TrajectoryFormat::kKitti), HasSubstr("found 8"));
}

TEST(ParseTrajectory, ShowsOnlyTheBeginningOfALongWord) {
  EXPECT_LT(parse_error(std::string(100'000, 'x')).size(), 400U);
}

TEST(ParseTrajectory, NormalisesAQuaternionThatWasRounded) {
  const auto file = parse_trajectory("1 0 0 0 0.5001 0.5 0.5 0.5\n", "a");
  ASSERT_TRUE(file);
  EXPECT_NEAR(file->poses[0].pose.rotation().norm(), 1.0, 1e-15);
}

TEST(ReadTrajectory, NamesAMissingFileAndADirectory) {
  const tests::TemporaryDirectory folder;
  const auto missing = read_trajectory(folder.path() / "none.txt");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(missing.error().message, HasSubstr("none.txt"));
  const auto directory = read_trajectory(folder.path());
  ASSERT_FALSE(directory);
  EXPECT_THAT(directory.error().message, HasSubstr(folder.path().string()));
}

TEST(WriteTum, IsReadBackWithExactTimes) {
  const std::uint64_t seed = tests::test_seed(1);
  std::mt19937_64 random{seed};
  std::uniform_int_distribution<std::int64_t> any_time{-2'000'000'000'000'000'000,
                                                       2'000'000'000'000'000'000};
  std::uniform_real_distribution<double> any{-3, 3};
  std::vector<std::int64_t> times(200);
  for (auto& t : times) {
    t = any_time(random);
  }
  std::ranges::sort(times);
  Trajectory poses;
  for (const std::int64_t t : times) {
    Vector6d xi;
    for (double& x : xi) {
      x = any(random);
    }
    poses.push_back({HostTime{nanoseconds{t}}, SE3::exp(xi)});
  }
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "poses.txt";
  ASSERT_TRUE(write_tum(path, poses));
  const auto read = read_trajectory(path, TrajectoryFormat::kTum);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->warnings.empty());
  ASSERT_EQ(read->poses.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(read->poses[i].t, poses[i].t) << "seed " << seed;
    const SE3 difference = read->poses[i].pose.inverse() * poses[i].pose;
    EXPECT_LT(difference.log().norm(), 4e-9) << "seed " << seed;
  }
}

TEST(WriteTum, SaysWhereItCouldNotWrite) {
  const tests::TemporaryDirectory folder;
  const auto written = write_tum(folder.path() / "none" / "poses.txt", {});
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().message, HasSubstr("none/poses.txt"));
}

TEST(FormatTumLine, KeepsNanosecondsAndChoosesTheSignOfTheQuaternion) {
  const StampedPose stamped{HostTime{nanoseconds{1305031102160407001}},
                            SE3{Eigen::Quaterniond{-0.5, 0.5, 0.5, 0.5}, Vector3d{1, -2, 0.25}}};
  EXPECT_EQ(format_tum_line(stamped),
            "1305031102.160407001 1.000000000 -2.000000000 0.250000000 -0.500000000 -0.500000000 "
            "-0.500000000 0.500000000");
  EXPECT_THAT(format_tum_line({HostTime{nanoseconds{-1}}, SE3{}}), HasSubstr("-0.000000001 "));
}

struct DataCase {
  const char* path;
  TrajectoryFormat format;
  std::size_t poses;
};

class ReadTrajectoryData : public testing::TestWithParam<DataCase> {};

TEST_P(ReadTrajectoryData, DetectsTheFormatAndReadsEveryPose) {
  GEOFLOW_DATA_OR_SKIP(path, GetParam().path);
  const auto file = read_trajectory(path);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->format, GetParam().format);
  EXPECT_EQ(file->poses.size(), GetParam().poses);
}

INSTANTIATE_TEST_SUITE_P(
    Published, ReadTrajectoryData,
    testing::Values(
        DataCase{"trajectories/KITTI_00_ORB.txt", TrajectoryFormat::kKitti, 4541},
        DataCase{"trajectories/KITTI_00_gt.txt", TrajectoryFormat::kKitti, 4541},
        DataCase{"trajectories/fr2_desk_ORB.txt", TrajectoryFormat::kTum, 2893},
        DataCase{"trajectories/freiburg1_xyz-groundtruth.txt", TrajectoryFormat::kTum, 3000},
        DataCase{"trajectories/freiburg1_xyz-rgbdslam.txt", TrajectoryFormat::kTum, 788}));

TEST(ReadTrajectoryEuroc, ReadsAllRows) {
  GEOFLOW_DATA_OR_SKIP(path, "euroc-v102/groundtruth.csv");
  const auto file = read_trajectory(path);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->format, TrajectoryFormat::kEuroc);
  EXPECT_GT(file->poses.size(), 1000U);
}

}  // namespace
}  // namespace geoflow::tools
