#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lz4frame.h>

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "bag/small_bag.hpp"
#include "fields.hpp"
#include "replay/bag/bag.hpp"
#include "replay/bag/chunk_codec.hpp"
#include "replay/bag/mcap_format.hpp"
#include "replay/bag/message_definitions.hpp"
#include "replay/bag/reader.hpp"

namespace geoflow::drivers {
namespace {

using bag::mcap::Opcode;
using test::read_all;
using test::Reading;
using test::write_file;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

std::string text(std::span<const std::byte> bytes) {
  std::string characters;
  for (const std::byte byte : bytes) {
    characters += static_cast<char>(byte);
  }
  return characters;
}

std::span<const std::byte> bytes(std::string_view characters) {
  return std::as_bytes(std::span{characters});
}

/// Pieces of MCAP files, as other software would make them.
std::string header() {
  FieldWriter out;
  bag::mcap::put_text(out, "ros2");
  bag::mcap::put_text(out, "test");
  return std::string{bag::mcap::kMagic} +
         text(bag::mcap::to_record(Opcode::kHeader, std::move(out).take()));
}

std::string channel() {
  return text(bag::mcap::to_record(bag::mcap::Schema{
             .id = 3, .name = "test/msg/A", .encoding = "ros2msg", .data = "int32 a\n"})) +
         text(bag::mcap::to_record(bag::mcap::Channel{
             .id = 7, .schema_id = 3, .topic = "/a", .message_encoding = "cdr", .metadata = {}}));
}

std::string message(std::uint64_t time_ns, std::string_view data) {
  return text(bag::mcap::begin_record({.channel_id = 7, .log_time_ns = time_ns}, data.size())) +
         std::string{data};
}

std::string lz4(const std::string& content) {
  std::string frame(LZ4F_compressFrameBound(content.size(), nullptr), '\0');
  frame.resize(
      LZ4F_compressFrame(frame.data(), frame.size(), content.data(), content.size(), nullptr));
  return frame;
}

struct Chunk {
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::string records;
  std::string compression{};

  [[nodiscard]] std::string record() const {
    const std::string stored = compression == "zstd"  ? test::zstd(records)
                               : compression == "lz4" ? lz4(records)
                                                      : records;
    return text(bag::mcap::begin_record({.start_ns = start_ns,
                                         .end_ns = end_ns,
                                         .content_bytes = records.size(),
                                         .content_crc = bag::crc32_of(bytes(records)),
                                         .compression = compression,
                                         .stored_bytes = stored.size()})) +
           stored;
  }
};

std::string end() {
  FieldWriter data_end;
  data_end.put(std::uint32_t{0});
  FieldWriter footer;
  footer.pad_to(bag::mcap::Footer::kBytes);
  return text(bag::mcap::to_record(Opcode::kDataEnd, std::move(data_end).take())) +
         text(bag::mcap::to_record(Opcode::kFooter, std::move(footer).take())) +
         std::string{bag::mcap::kMagic};
}

class McapFileTest : public testing::Test {
 protected:
  [[nodiscard]] Reading read(const std::string& content) const {
    write_file(path_, content);
    return read_all(path_);
  }
  tests::TemporaryDirectory folder_;
  std::filesystem::path path_ = folder_.path() / "x.mcap";
};

TEST_F(McapFileTest, ChunksOfEveryCompressionAreReadInOrderOfTime) {
  std::string content = header();
  content += Chunk{10, 40, channel() + message(10, "m0") + message(40, "m3"), "zstd"}.record();
  content += Chunk{20, 30, message(30, "m2") + message(20, "m1"), "lz4"}.record();
  content += Chunk{40, 50, message(40, "m4") + message(50, "m5")}.record();
  const Reading reading = read(content + end());
  EXPECT_THAT(reading.data, ElementsAre("m0", "m1", "m2", "m3", "m4", "m5"));
  EXPECT_THAT(reading.errors, IsEmpty());
  EXPECT_TRUE(reading.complete);
  const auto bag = bag::Bag::open(path_);
  ASSERT_TRUE(bag) << bag.error().message;
  ASSERT_THAT((*bag)->topics(), SizeIs(1));
  EXPECT_EQ((*bag)->topics().front().name, "/a");
  EXPECT_EQ((*bag)->topics().front().type, "test/msg/A");
  EXPECT_EQ((*bag)->topics().front().count, 6U) << "counted where the file has no statistics";
  EXPECT_EQ((*bag)->start_ns(), 10);
  EXPECT_EQ((*bag)->end_ns(), 50);
}

TEST_F(McapFileTest, MessagesOutsideOfChunksAreReadInOrderOfTime) {
  const Reading reading =
      read(header() + channel() + message(30, "m2") + message(10, "m0") +
           Chunk{20, 20, message(20, "m1")}.record() + message(40, "m3") + end());
  EXPECT_THAT(reading.data, ElementsAre("m0", "m1", "m2", "m3"));
  EXPECT_THAT(reading.errors, IsEmpty());
}

TEST_F(McapFileTest, ADamagedChunkIsNamedAndReadingGoesOnBehindIt) {
  const std::string before = header() + channel() + Chunk{1, 1, message(1, "m0")}.record();
  std::string damaged = Chunk{2, 2, message(2, "m1")}.record();
  damaged.back() = '?';
  const Reading reading =
      read(before + damaged + Chunk{3, 3, message(3, "m2"), "zstd"}.record() + end());
  EXPECT_THAT(reading.data, ElementsAre("m0", "m2"));
  ASSERT_THAT(reading.errors, SizeIs(1));
  EXPECT_EQ(reading.errors.front().message,
            fmt::format("{}: chunk at byte {}: has another checksum than is stated: it is damaged",
                        path_.native(), before.size()));
  EXPECT_FALSE(reading.complete);
}

TEST_F(McapFileTest, ChunksThatCannotBeReadSayWhy) {
  const auto error_of = [&](Chunk chunk, const std::string& compression, const char* bytes) {
    chunk.compression = compression;
    std::string record = chunk.record();
    record.replace(record.size() - std::string_view{bytes}.size(), std::string::npos, bytes);
    const Reading reading = read(header() + channel() + record + end());
    return reading.errors.empty() ? std::string{} : reading.errors.front().message;
  };
  const Chunk chunk{1, 1, message(1, std::string(300, 'x'))};
  EXPECT_THAT(error_of(chunk, "snappy", ""), HasSubstr("'snappy' is not supported, only zstd"));
  EXPECT_THAT(error_of(chunk, "zstd", "????????"), HasSubstr("damaged Zstandard frame"));
  EXPECT_THAT(error_of(chunk, "lz4", "????????"), HasSubstr("damaged LZ4 frame"));
  EXPECT_THAT(error_of({1, 1, "\x05 short"}, "", ""), HasSubstr("longer than what is left"));
}

TEST_F(McapFileTest, AFileThatWasCutOffGivesWhatIsWholeAndThenAnError) {
  std::string content = header() + channel();
  std::vector<std::size_t> ends;
  for (std::uint64_t i = 0; i < 4; ++i) {
    content += Chunk{i, i, message(i, "m"), i % 2 == 0 ? "zstd" : "lz4"}.record();
    ends.push_back(content.size());
  }
  for (std::size_t size = bag::mcap::kMagic.size(); size <= content.size(); ++size) {
    const Reading reading = read(content.substr(0, size));
    const auto whole = std::ranges::count_if(ends, [&](std::size_t at) { return at <= size; });
    ASSERT_THAT(reading.data, SizeIs(whole)) << size;
    ASSERT_THAT(reading.errors, SizeIs(1)) << size;
    ASSERT_THAT(reading.errors.front().message, HasSubstr("is cut off")) << size;
    ASSERT_FALSE(reading.complete);
  }
}

TEST_F(McapFileTest, WhatIsNoRecordIsNamedWithItsByte) {
  const Reading zero = read(header() + std::string(40, '\0'));
  ASSERT_THAT(zero.errors, SizeIs(1));
  EXPECT_EQ(zero.errors.front().message, fmt::format("{}: byte {}: no record begins with a zero",
                                                     path_.native(), header().size()));
  const Reading small = read(header() + text(bag::mcap::to_record(Opcode::kChannel, {})) + end());
  ASSERT_THAT(small.errors, SizeIs(1));
  EXPECT_THAT(small.errors.front().message, HasSubstr("a channel record is too short"));
  EXPECT_THAT(read("").errors.front().message, HasSubstr("is empty or cannot be read"));
}

TEST_F(McapFileTest, AChunkThatSaysItIsHugeIsRefused) {
  Chunk chunk{1, 1, message(1, "m"), "zstd"};
  std::string record = chunk.record();
  const std::size_t size_at = bag::mcap::kRecordHeadBytes + 16;
  record.replace(size_at, 8, "\xff\xff\xff\xff\xff\xff\xff\x7f", 8);
  const Reading reading = read(header() + channel() + record + end());
  ASSERT_THAT(reading.errors, SizeIs(1));
  EXPECT_THAT(reading.errors.front().message, HasSubstr("more than"));
}

TEST(RecordedMcap, ARealFileIsListedAndRead) {
  GEOFLOW_DATA_OR_SKIP(data, "rosbag2");
  const auto path = data / "nav2_turtlebot.mcap";
  EXPECT_TRUE(bag::looks_like(path));
  const auto bag = bag::Bag::open(path);
  ASSERT_TRUE(bag) << bag.error().message;
  std::uint64_t stated = 0;
  std::vector<std::string> names;
  for (const auto& topic : (*bag)->topics()) {
    stated += topic.count;
    names.push_back(topic.name + " " + topic.type);
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre(
                         "/odom nav_msgs/msg/Odometry", "/tf tf2_msgs/msg/TFMessage",
                         "/tf_static tf2_msgs/msg/TFMessage",
                         "/amcl_pose geometry_msgs/msg/PoseWithCovarianceStamped"));
  const Reading reading = read_all(path);
  EXPECT_THAT(reading.errors, IsEmpty());
  EXPECT_EQ(reading.times_ns.size(), stated);
  EXPECT_GT(stated, 1000U);
  EXPECT_TRUE(std::ranges::is_sorted(reading.times_ns));
  const auto reader = bag::open(path, {});
  ASSERT_FALSE(reader);
  EXPECT_THAT(reader.error().message, HasSubstr("the bag has: "));
  EXPECT_THAT(reader.error().message, HasSubstr("/odom (nav_msgs/msg/Odometry"));
}

TEST(McapWriter, AClosedBagIsOneFileAndItsDescription) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "walk";
  auto writer = BagWriter::create({.directory = path, .storage = BagStorage::kMcap}, {});
  ASSERT_TRUE(writer) << writer.error().message;
  (*writer)->on_imu({DeviceTime<ImuClock>{Duration{5}}, HostTime{Duration{9}}, {}});
  // As it would be found after a power cut: nothing is on the disk yet but the beginning.
  EXPECT_THAT(read_all(path / "walk_0.mcap").errors.front().message, HasSubstr("is cut off"));
  ASSERT_TRUE((*writer)->close());
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator{path}) {
    names.push_back(entry.path().filename());
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre("metadata.yaml", "walk_0.mcap"));
  EXPECT_THAT(test::read_file(path / "metadata.yaml"), HasSubstr("storage_identifier: mcap"));
  for (const auto& opened : {path, path / "walk_0.mcap"}) {
    const auto bag = bag::Bag::open(opened);
    ASSERT_TRUE(bag) << bag.error().message;
    ASSERT_THAT((*bag)->topics(), SizeIs(1));
    EXPECT_EQ((*bag)->topics().front().type, "sensor_msgs/msg/Imu");
    EXPECT_EQ((*bag)->topics().front().count, 1U);
    EXPECT_FALSE((*bag)->custom_data().empty()) << "what no standard message says";
  }
}

TEST(McapWriter, WhatIsWrittenBeforeACrashIsRead) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "walk";
  auto writer = BagWriter::create({.directory = path,
                                   .storage = BagStorage::kMcap,
                                   .compress = true,
                                   .commit_after = Duration{}},
                                  {});
  ASSERT_TRUE(writer);
  for (int i = 1; i <= 20; ++i) {
    (*writer)->on_imu({DeviceTime<ImuClock>{Duration{i}}, HostTime{Duration{i}}, {}});
  }
  const Reading reading = read_all(path / "walk_0.mcap");
  EXPECT_THAT(reading.data, SizeIs(20));
  ASSERT_THAT(reading.errors, SizeIs(1));
  EXPECT_THAT(reading.errors.front().message, HasSubstr("is cut off"));
}

TEST(MessageDefinition, HasEveryPartOnce) {
  const std::string odometry = bag::message_definition("nav_msgs/msg/Odometry");
  EXPECT_THAT(odometry, testing::StartsWith("std_msgs/Header header\nstring child_frame_id\n"));
  for (const char* part :
       {"std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Pose", "geometry_msgs/Point",
        "geometry_msgs/Quaternion", "geometry_msgs/TwistWithCovariance", "geometry_msgs/Vector3"}) {
    const std::string heading = fmt::format("{:=<80}\nMSG: {}\n", "", part);
    const auto first = odometry.find(heading);
    ASSERT_NE(first, std::string::npos) << part;
    EXPECT_EQ(odometry.find(heading, first + 1), std::string::npos) << part;
  }
  EXPECT_EQ(bag::message_definition("std_msgs/msg/String"), "");
  EXPECT_EQ(bag::message_definition("Odometry"), "");
}

}  // namespace
}  // namespace geoflow::drivers
