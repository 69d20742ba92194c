#include "replay/bag/bag.hpp"

#include <algorithm>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/data.hpp"

#include "bag/small_bag.hpp"
#include "replay/bag/metadata.hpp"

namespace geoflow::drivers {
namespace {

using test::read_all;
using test::Reading;
using test::SmallBag;
using test::write_file;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(Bag, FilesThatOverlapInTimeAreReadInOrderOfTime) {
  const tests::TemporaryDirectory folder;
  SmallBag{.start_ns = 1000, .step_ns = 20, .count = 30}.write(folder.path() / "x_0.db3");
  SmallBag{.start_ns = 1310, .step_ns = 20, .count = 30}.write(folder.path() / "x_1.db3");
  SmallBag{.start_ns = 5000, .step_ns = 20, .count = 5}.write(folder.path() / "x_2.db3");
  const Reading reading = read_all(folder.path());
  EXPECT_EQ(reading.times_ns.size(), 65U);
  EXPECT_TRUE(std::ranges::is_sorted(reading.times_ns));
  EXPECT_TRUE(reading.complete);
  const auto bag = bag::Bag::open(folder.path());
  ASSERT_TRUE(bag);
  ASSERT_EQ((*bag)->topics().size(), 1U);
  EXPECT_EQ((*bag)->topics().front().count, 65U);
  EXPECT_EQ((*bag)->start_ns(), 1000);
  EXPECT_EQ((*bag)->end_ns(), 5080);
}

TEST(Bag, EqualTimesKeepTheOrderOfRecording) {
  const tests::TemporaryDirectory folder;
  SmallBag{.step_ns = 0, .count = 4, .bytes = 2}.write(folder.path() / "x.db3");
  EXPECT_THAT(read_all(folder.path()).data, ElementsAre("m0", "m1", "m2", "m3"));
}

TEST(Bag, FileWithoutTheIndexOnTimeIsReadAlike) {
  const tests::TemporaryDirectory folder;
  const auto path = folder.path() / "x.db3";
  SmallBag{.start_ns = 1000, .step_ns = -10, .count = 4, .bytes = 2}.write(path);
  test::SqlFile{path}.execute("DROP INDEX timestamp_idx");
  EXPECT_THAT(read_all(path).data, ElementsAre("m3", "m2", "m1", "m0"));
}

TEST(Bag, DescriptionOfEveryVersionIsRead) {
  const tests::TemporaryDirectory folder;
  SmallBag{.start_ns = 100, .count = 2, .bytes = 2}.write(folder.path() / "x_0.db3");
  SmallBag{.start_ns = 300, .count = 2, .bytes = 2}.write(folder.path() / "x_1.db3");
  const std::string common =
      "  storage_identifier: sqlite3\n"
      "  duration: {nanoseconds: 210}\n"
      "  starting_time: {nanoseconds_since_epoch: 100}\n"
      "  message_count: 4\n"
      "  topics_with_message_count:\n"
      "    - topic_metadata: {name: /a, type: test/msg/A, serialization_format: cdr";
  const std::string version_1 =
      "rosbag2_bagfile_information:\n  version: 1\n" + common +
      "}\n      message_count: 4\n  relative_file_paths: [recorded/x_1.db3, recorded/x_0.db3]\n";
  const std::string version_5 =
      "rosbag2_bagfile_information:\n  version: 5\n" + common +
      ", offered_qos_profiles: \"- history: 3\"}\n      message_count: 4\n  compression_format: "
      "\"\"\n"
      "  compression_mode: \"\"\n  relative_file_paths: [x_1.db3, x_0.db3]\n  files:\n"
      "    - {path: x_1.db3, starting_time: {nanoseconds_since_epoch: 300}, duration: "
      "{nanoseconds: 10}, message_count: 2}\n"
      "    - {path: x_0.db3, starting_time: {nanoseconds_since_epoch: 100}, duration: "
      "{nanoseconds: 10}, message_count: 2}\n";
  const std::string version_9 = "rosbag2_bagfile_information:\n  version: 9\n" + common +
                                ", offered_qos_profiles: [{history: keep_last, depth: 10}], "
                                "type_description_hash: RIHS01_0}\n      message_count: "
                                "4\n  compression_format: \"\"\n  compression_mode: \"\"\n  "
                                "relative_file_paths: [x_1.db3, x_0.db3]\n  files: []\n"
                                "  custom_data: {key: value}\n  ros_distro: jazzy\n";
  for (const std::string& yaml : {version_1, version_5, version_9}) {
    write_file(folder.path() / "metadata.yaml", yaml);
    const auto bag = bag::Bag::open(folder.path());
    ASSERT_TRUE(bag) << bag.error().message;
    EXPECT_EQ((*bag)->topics().front().count, 4U);
    EXPECT_EQ((*bag)->end_ns(), 310);
    EXPECT_THAT(read_all(folder.path()).times_ns, ElementsAre(100, 110, 300, 310)) << yaml;
  }
}

TEST(Bag, DescriptionThatCannotBeReadNamesTheLine) {
  const auto parsed =
      bag::parse_metadata("rosbag2_bagfile_information:\n  version: x\n", "metadata.yaml");
  ASSERT_FALSE(parsed);
  EXPECT_THAT(parsed.error().message, testing::StartsWith("metadata.yaml:2: "));
  EXPECT_FALSE(bag::parse_metadata("{[", "m"));
  EXPECT_FALSE(bag::parse_metadata("", "m"));
  EXPECT_FALSE(bag::parse_metadata("- 1\n- 2\n", "m"));
}

TEST(Bag, DescriptionReadsBackAsItWasWritten) {
  bag::Metadata metadata;
  metadata.start_ns = 1'700'000'000'123'456'789;
  metadata.duration_ns = 42;
  metadata.message_count = 3;
  metadata.topics = {{.name = "/a",
                      .type = "x/msg/Y",
                      .offered_qos_profiles = "- history: 1\n",
                      .message_count = 3}};
  metadata.compression_format = "zstd";
  metadata.compression_mode = "MESSAGE";
  metadata.relative_file_paths = {"a_0.db3"};
  metadata.files = {{.path = "a_0.db3", .start_ns = 1, .duration_ns = 42, .message_count = 3}};
  metadata.custom_data = {{"geoflow.depth_unit_m", "0.0002"}, {"empty", ""}};
  for (const std::string& yaml : {to_yaml(metadata), to_stored_yaml(metadata)}) {
    const auto read = bag::parse_metadata(yaml, "metadata.yaml");
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->version, 8);
    EXPECT_EQ(read->start_ns, metadata.start_ns);
    EXPECT_EQ(read->duration_ns, 42);
    EXPECT_EQ(read->topics.front().name, "/a");
    EXPECT_EQ(read->compression_mode, "MESSAGE");
    EXPECT_EQ(read->files.front().path, "a_0.db3");
    EXPECT_EQ(read->custom_data, metadata.custom_data);
  }
}

TEST(Bag, FileOfASplitBagThatIsMissingIsAnErrorAndTheOthersAreRead) {
  const tests::TemporaryDirectory folder;
  SmallBag{.start_ns = 100, .count = 2, .bytes = 2}.write(folder.path() / "x_0.db3");
  SmallBag{.start_ns = 500, .count = 2, .bytes = 2}.write(folder.path() / "x_2.db3");
  write_file(folder.path() / "metadata.yaml",
             "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"
             "  relative_file_paths: [x_0.db3, x_1.db3, x_2.db3]\n  topics_with_message_count: "
             "[]\n  files:\n"
             "    - {path: x_0.db3, starting_time: {nanoseconds_since_epoch: 100}}\n"
             "    - {path: x_1.db3, starting_time: {nanoseconds_since_epoch: 300}}\n"
             "    - {path: x_2.db3, starting_time: {nanoseconds_since_epoch: 500}}\n");
  const Reading reading = read_all(folder.path());
  EXPECT_THAT(reading.times_ns, ElementsAre(100, 110, 500, 510));
  ASSERT_EQ(reading.errors.size(), 1U);
  EXPECT_THAT(reading.errors.front().message, HasSubstr("x_1.db3"));
  EXPECT_FALSE(reading.complete);
}

}  // namespace
}  // namespace geoflow::drivers
