#include "replay/text.hpp"

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "tests/support/data.hpp"

#include "replay/fixtures.hpp"
#include "replay/image_list.hpp"
#include "replay/line_file.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

using geoflow::tests::TemporaryDirectory;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::message_of;

TEST(Text, SecondsAreExactToTheNanosecond) {
  using std::chrono::nanoseconds;
  EXPECT_EQ(text::parse_seconds("1305031453.359684"), nanoseconds{1305031453359684000});
  EXPECT_EQ(text::parse_seconds("0.0000000019"), nanoseconds{1});
  EXPECT_EQ(text::parse_seconds("12"), nanoseconds{12000000000});
  EXPECT_EQ(text::parse_seconds("12."), nanoseconds{12000000000});
  EXPECT_EQ(text::parse_seconds("1.5e3"), nanoseconds{1500000000000});
  for (const char* bad : {"", ".", "-1", "1.2.3", "abc", "1.x", "99999999999999", "nan", "inf",
                          "1e99", "+1", "0x1"}) {
    EXPECT_EQ(text::parse_seconds(bad), std::nullopt) << bad;
  }
}

TEST(Text, NanosecondsAreWholeAndBounded) {
  EXPECT_EQ(text::parse_nanoseconds("1403715523912143104"), Duration{1403715523912143104});
  for (const char* bad : {"", "-1", "1.0", "9223372036854775807", "99999999999999999999", "1 2"}) {
    EXPECT_EQ(text::parse_nanoseconds(bad), std::nullopt) << bad;
  }
}

TEST(Text, NumbersMustBeFinite) {
  EXPECT_EQ(text::parse_number("-1.5e-3"), -1.5e-3);
  for (const char* bad : {"", "nan", "inf", "-inf", "1e999", "1,5", "1 "}) {
    EXPECT_EQ(text::parse_number(bad), std::nullopt) << bad;
  }
}

std::vector<std::string> data_lines(std::string_view content) {
  std::vector<std::string> lines;
  const auto done =
      text::for_each_line("list", content, [&](const text::Line& line) -> Result<void> {
        lines.push_back(std::to_string(line.number) + ":" + std::string{line.text});
        return {};
      });
  if (!done) {
    lines.push_back(done.error().message);
  }
  return lines;
}

TEST(Text, SkipsCommentsAndLineEndsOfEveryKind) {
  EXPECT_THAT(data_lines("# a comment\r\n\r\n  one  \r\n\n\ttwo\n # more\nthree"),
              ElementsAre("3:one", "5:two", "7:three"));
  EXPECT_THAT(data_lines(""), ElementsAre());
}

TEST(Text, RefusesWhatIsNoText) {
  EXPECT_THAT(data_lines(std::string{"one\nt\0o\n", 8}),
              ElementsAre("1:one", HasSubstr("list:2: a zero byte")));
  EXPECT_THAT(data_lines(std::string(5000, 'x')),
              ElementsAre(HasSubstr("list:1: a line of 5000 bytes")));
}

TEST(LineFile, ReadsAsForEachLineAndGoesOnBehindABadLine) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "file.txt";
  tests::write_text(path, "# head\none\r\n" + std::string(9000, 'x') + "\ntwo");
  auto file = text::LineFile::open(path);
  ASSERT_TRUE(file);
  auto line = file->next();
  ASSERT_TRUE(line && *line);
  EXPECT_EQ((*line)->text, "one");
  EXPECT_EQ((*line)->number, 2U);
  EXPECT_THAT(message_of(file->next()),
              AllOf(HasSubstr("file.txt:3"), HasSubstr("more than 4096 bytes")));
  line = file->next();
  ASSERT_TRUE(line && *line);
  EXPECT_EQ((*line)->text, "two");
  EXPECT_EQ((*line)->number, 4U);
  line = file->next();
  ASSERT_TRUE(line);
  EXPECT_FALSE(*line);
}

TEST(ImageList, NamesListAndLineOfWhatItCannotRead) {
  EXPECT_THAT(message_of(parse_image_list("rgb.txt", "# c\n1.0 a.png\n2.0\n", ImageStream::kColor)),
              HasSubstr("rgb.txt:3: 1 fields"));
  EXPECT_THAT(message_of(parse_image_list("rgb.txt", "soon a.png\n", ImageStream::kColor)),
              HasSubstr("rgb.txt:1: 'soon' is not a time"));
  EXPECT_THAT(message_of(parse_associations("assoc.txt", "1 rgb/a.png\n")),
              HasSubstr("assoc.txt:1: 2 fields"));
}

TEST(Associations, TellColorFromDepthByTheirNames) {
  const auto color_first = parse_associations("a", "1.0 rgb/a.png 1.1 depth/a.png\n");
  const auto depth_first = parse_associations("a", "1.1 depth/a.png 1.0 rgb/a.png\n");
  const auto unnamed = parse_associations("a", "1.0 x/a.png 1.1 y/a.png\n");
  ASSERT_TRUE(color_first && depth_first && unnamed);
  EXPECT_EQ((*color_first)[0].stream, ImageStream::kColor);
  EXPECT_EQ((*depth_first)[0].stream, ImageStream::kDepth);
  EXPECT_EQ((*depth_first)[1].stream, ImageStream::kColor);
  EXPECT_EQ((*unnamed)[0].stream, ImageStream::kColor);
  EXPECT_EQ((*unnamed)[1].stream, ImageStream::kDepth);
}

TEST(Associations, OfRealSequencesAreRead) {
  GEOFLOW_DATA_OR_SKIP(directory, "tum-timestamps");
  std::size_t lists = 0;
  for (const auto& entry : std::filesystem::directory_iterator{directory}) {
    const auto content = text::read_file(entry.path(), std::size_t{1} << 24U);
    ASSERT_TRUE(content);
    const auto images = parse_associations(entry.path().filename().string(), *content);
    ASSERT_TRUE(images) << images.error().message;
    EXPECT_GT(images->size(), 500U) << entry.path();
    ++lists;
  }
  EXPECT_EQ(lists, 11U);
}

}  // namespace
}  // namespace geoflow::drivers
