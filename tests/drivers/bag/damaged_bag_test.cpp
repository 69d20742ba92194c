#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <string>
#include <string_view>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "bag/small_bag.hpp"

/// Bags that were cut, damaged, or made to do harm.
namespace geoflow::drivers {
namespace {

using test::read_all;
using test::read_file;
using test::Reading;
using test::SmallBag;
using test::SqlFile;
using test::write_file;
using testing::HasSubstr;

void expect_named_errors(const Reading& reading, const std::filesystem::path& path) {
  for (const Error& error : reading.errors) {
    EXPECT_THAT(error.message, HasSubstr(path.native()));
  }
}

/// Cuts the file shorter byte by byte and expects an error that names it every time.
void expect_error_at_any_cut(const std::filesystem::path& path) {
  for (auto size = std::filesystem::file_size(path); size-- > 0;) {
    std::filesystem::resize_file(path, size);
    const Reading reading = read_all(path);
    ASSERT_EQ(reading.errors.size(), 1U) << size;
    ASSERT_THAT(reading.errors.front().message, HasSubstr(path.native())) << size;
    ASSERT_FALSE(reading.complete);
  }
}

TEST(DamagedBag, CutAtAnyByteIsAnErrorThatNamesTheFile) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag.db3";
  SmallBag{}.write(path);
  ASSERT_EQ(read_all(path).data.size(), 20U);
  expect_error_at_any_cut(path);
}

TEST(DamagedBag, CutBagOfTheWriterSaysHowMuchIsMissing) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag";
  auto writer = BagWriter::create({.directory = path}, {});
  ASSERT_TRUE(writer);
  for (int i = 0; i < 100; ++i) {
    (*writer)->on_imu({DeviceTime<ImuClock>{Duration{i}}, HostTime{Duration{i}}, {}});
  }
  ASSERT_TRUE((*writer)->close());
  const auto database = path / "bag_0.db3";
  const auto size = std::filesystem::file_size(database);
  std::filesystem::resize_file(database, size - 1);
  const Reading reading = read_all(path);
  ASSERT_EQ(reading.errors.size(), 1U);
  EXPECT_EQ(reading.errors.front().message,
            fmt::format("{}: is cut off: {} bytes are there, {} belong to the database",
                        database.native(), size - 1, size));
}

TEST(DamagedBag, DamageInsideNamesTheMessageAndSparesTheOthers) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag.db3";
  SmallBag bag;
  bag.bytes = 2000;  // spills over to pages of their own
  bag.write(path);
  std::string content = read_file(path);
  const auto at = content.find("m7.");
  ASSERT_NE(at, std::string::npos);
  // The spilled part's first page number stands behind the local part of the row: make it point
  // beyond the file.
  const auto local_end = content.find_first_not_of('.', at + 2);
  std::fill_n(content.begin() + static_cast<std::ptrdiff_t>(local_end), 4, '\x7f');
  write_file(path, content);
  const Reading reading = read_all(path);
  EXPECT_EQ(reading.data.size(), 19U);
  ASSERT_EQ(reading.errors.size(), 1U);
  EXPECT_THAT(reading.errors.front().message, HasSubstr(path.native() + ": message 8 (/a): "));
}

TEST(DamagedBag, AnyDamageIsSurvived) {
  const tests::TemporaryDirectory folder;
  const auto whole_path = folder.path() / "whole.db3";
  SmallBag{.count = 40, .bytes = 900}.write(whole_path);
  const std::string whole = read_file(whole_path);
  const auto path = folder.path() / "damaged.db3";
  EXPECT_TRUE(rc::check([&] {
    std::string content = whole;
    const int count = *rc::gen::inRange(1, 20);
    for (int i = 0; i < count; ++i) {
      content[*rc::gen::inRange<std::size_t>(0, content.size())] = *rc::gen::arbitrary<char>();
    }
    write_file(path, content);
    expect_named_errors(read_all(path), path);
  }));
}

TEST(DamagedBag, CompressedFileCutAnywhereIsAnError) {
  const tests::TemporaryDirectory folder;
  const auto plain = folder.path() / "plain.db3";
  SmallBag{.count = 3}.write(plain);
  const auto path = folder.path() / "bag.db3.zstd";
  write_file(path, test::zstd(read_file(plain)));
  ASSERT_EQ(read_all(path).data.size(), 3U);
  expect_error_at_any_cut(path);
}

TEST(DamagedBag, CompressedFileLeavesNothingBehind) {
  const tests::TemporaryDirectory folder;
  const tests::TemporaryDirectory scratch;
  const auto plain = folder.path() / "plain.db3";
  SmallBag{}.write(plain);
  const auto path = folder.path() / "bag.db3.zstd";
  write_file(path, test::zstd(read_file(plain)));
  // NOLINTBEGIN(concurrency-mt-unsafe): this test has no other thread
  ::setenv("TMPDIR", scratch.path().c_str(), 1);
  EXPECT_EQ(read_all(path).data.size(), 20U);
  ::unsetenv("TMPDIR");
  // NOLINTEND(concurrency-mt-unsafe)
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(DamagedBag, BagWhoseWriterDiedIsReadWithItsLogAndLeftAsItIs) {
  const tests::TemporaryDirectory folder;
  const auto live = folder.path() / "live";
  const auto dead = folder.path() / "dead";
  auto writer = BagWriter::create({.directory = live, .commit_after = Duration{}}, {});
  ASSERT_TRUE(writer);
  for (int i = 0; i < 50; ++i) {
    (*writer)->on_imu({DeviceTime<ImuClock>{Duration{i}}, HostTime{Duration{i}}, {}});
  }
  // What a power cut leaves: the files as they are now.
  std::filesystem::create_directory(dead);
  std::filesystem::copy_file(live / "live_0.db3", dead / "live_0.db3");
  std::filesystem::copy_file(live / "live_0.db3-wal", dead / "live_0.db3-wal");
  const std::string database = read_file(dead / "live_0.db3");
  const std::string log = read_file(dead / "live_0.db3-wal");

  const Reading reading = read_all(dead);

  EXPECT_EQ(reading.times_ns.size(), 50U);
  EXPECT_TRUE(reading.complete) << (reading.errors.empty() ? "" : reading.errors.front().message);
  EXPECT_EQ(read_file(dead / "live_0.db3"), database);
  EXPECT_EQ(read_file(dead / "live_0.db3-wal"), log);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator{dead}, {}), 2);
}

TEST(DamagedBag, LogCutAnywhereLeavesTheMessagesBeforeTheCut) {
  const tests::TemporaryDirectory folder;
  const auto live = folder.path() / "live";
  auto writer = BagWriter::create({.directory = live, .commit_after = Duration{}}, {});
  ASSERT_TRUE(writer);
  for (int i = 0; i < 8; ++i) {
    (*writer)->on_imu({DeviceTime<ImuClock>{Duration{i}}, HostTime{Duration{i}}, {}});
  }
  const auto path = folder.path() / "cut.db3";
  write_file(path, read_file(live / "live_0.db3"));
  const std::string log = read_file(live / "live_0.db3-wal");
  std::size_t last_count = 0;
  constexpr std::size_t kStride = 20011;
  for (std::size_t size = 1; size <= log.size(); size += kStride) {
    write_file(folder.path() / "cut.db3-wal", std::string_view{log}.substr(0, size));
    const Reading reading = read_all(path);
    expect_named_errors(reading, path);
    EXPECT_GE(reading.times_ns.size(), last_count) << size;
    last_count = reading.times_ns.size();
  }
  EXPECT_GE(last_count, 7U);
}

TEST(DamagedBag, ViewInPlaceOfATableIsNotRun) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag.db3";
  SqlFile{path}.execute(
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format "
      "TEXT);"
      "INSERT INTO topics VALUES (1, '/a', 'test/msg/A', 'cdr');"
      "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
      "SELECT id, 1 AS topic_id, id AS timestamp, 'x' AS data FROM n;");
  const Reading reading = read_all(path);
  ASSERT_EQ(reading.errors.size(), 1U);
  EXPECT_THAT(reading.errors.front().message, HasSubstr("has no tables topics and messages"));
}

TEST(DamagedBag, TimesOutOfRangeAreErrorsOfTheirMessages) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "bag.db3";
  SmallBag{.count = 3}.write(path);
  SqlFile{path}.execute("UPDATE messages SET timestamp = -9223372036854775808 WHERE id = 2");
  const Reading reading = read_all(path);
  EXPECT_EQ(reading.data.size(), 2U);
  ASSERT_EQ(reading.errors.size(), 1U);
  EXPECT_THAT(reading.errors.front().message,
              HasSubstr("message 2 (/a): time -9223372036854775808 ns is out of range"));
}

TEST(DamagedBag, OtherFilesAndStoragesAreNamed) {
  const tests::TemporaryDirectory folder;
  const auto text = folder.path() / "text.db3";
  write_file(text, "this is not a database, whatever its name says");
  EXPECT_EQ(read_all(text).errors.front().message,
            text.native() + ": is neither an SQLite database nor a Zstandard file");
  const auto other = folder.path() / "other.db3";
  SqlFile{other}.execute("CREATE TABLE t(x)");
  EXPECT_THAT(read_all(other).errors.front().message,
              HasSubstr("has no tables topics and messages: not a bag"));
  const auto missing = folder.path() / "missing";
  EXPECT_EQ(read_all(missing).errors.front().message,
            missing.native() + ": no such file or folder");
  const auto unknown = folder.path() / "unknown";
  std::filesystem::create_directory(unknown);
  EXPECT_THAT(read_all(unknown).errors.front().message, HasSubstr("holds no bag"));
  write_file(unknown / "metadata.yaml",
             "rosbag2_bagfile_information:\n  version: 8\n  storage_identifier: leveldb\n");
  EXPECT_THAT(read_all(unknown).errors.front().message,
              HasSubstr("storage 'leveldb' is not supported"));
}

}  // namespace
}  // namespace geoflow::drivers
