#include "can/candump.hpp"

#include <cstddef>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"

namespace geoflow::drivers::can {
namespace {

using testing::HasSubstr;

TEST(CandumpLog, LinesOfEveryKindAreReadAndWrittenAsTheyWere) {
  const std::vector<std::string_view> lines = {
      "(1436509052.249713) can0 044#2A366C2B",
      "(1436509052.249714) vcan1 7FF#",
      "(0.000001) can0 1FFFFFFF#0102030405060708",
      "(1436509052.249713) can0 123#R",
      "(1436509052.249713) can0 210##1000102030405060708090A0B",
      "(1436509052.249713) can0 20000040#0000000000000000",
  };
  for (const std::string_view line : lines) {
    const auto read = parse_log_line(line);
    ASSERT_TRUE(read) << line << ": " << read.error().message;
    EXPECT_EQ(format_log_line(read->stamp, read->interface, read->frame), line);
  }
}

TEST(CandumpLog, WhatALineMeans) {
  const auto classic = parse_log_line("(1436509052.249713) can0 044#2A366C2B R").value();
  EXPECT_EQ(classic.stamp, Duration{1'436'509'052'249'713'000});
  EXPECT_EQ(classic.interface, "can0");
  EXPECT_EQ(classic.frame.id, 0x44U);
  EXPECT_FALSE(classic.frame.extended);
  EXPECT_EQ(classic.frame.length, 4U);
  EXPECT_EQ(classic.frame.data[3], std::byte{0x2B});
  const Frame extended = parse_log_line("(1.0) can0 00000044#2A").value().frame;
  EXPECT_TRUE(extended.extended);
  EXPECT_EQ(extended.id, 0x44U);
  const Frame fd = parse_log_line("(1.0) can0 210##3").value().frame;
  EXPECT_TRUE(fd.fd);
  EXPECT_EQ(fd.fd_flags, 3U);
  EXPECT_EQ(fd.length, 0U);
  EXPECT_TRUE(parse_log_line("(1.0) can0 210#R8").value().frame.remote);
  EXPECT_EQ(parse_log_line("(1.0) can0 210#0011223344556677_9").value().frame.length, 8U);
}

TEST(CandumpLog, WhatIsNoFrameIsRefusedInWords) {
  // What is refused, an arrow, and what is said of it.
  std::istringstream cases{R"(-> 0 fields where 3 are expected
(1.0) can0 -> 2 fields where 3 are expected
(1.0) can0 044#00 R x -> 5 fields
1.0 can0 044#00 -> '1.0' is no time
(-1.0) can0 044#00 -> '(-1.0)' is no time
(1.0) can0 04400 -> has no # between
(1.0) can0 44#00 -> '44' is no identifier of 3 or 8
(1.0) can0 04G#00 -> '04G' is no identifier
(1.0) can0 800#00 -> identifier 800 has more than 11 bits
(1.0) can0 80000000#00 -> identifier 80000000 has more than 29 bits
(1.0) can0 044#0 -> 1 digits are no payload of a classic frame
(1.0) can0 044#001122334455667788 -> 18 digits are no payload
(1.0) can0 044#0- -> '0-' is no byte
(1.0) can0 044## -> is no CAN FD frame
(1.0) can0 044##1001122334455667788 -> 18 digits are no payload of a CAN FD frame
)"};
  std::size_t refused = 0;
  for (std::string line; std::getline(cases, line); ++refused) {
    const std::size_t arrow = line.find("-> ");
    const auto read = parse_log_line(std::string_view{line}.substr(0, arrow));
    ASSERT_FALSE(read) << line;
    EXPECT_THAT(read.error().message, HasSubstr(line.substr(arrow + 3))) << line;
  }
  EXPECT_EQ(refused, 15U);
}

}  // namespace
}  // namespace geoflow::drivers::can
