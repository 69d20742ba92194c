#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/result.hpp"
#include "tests/support/data.hpp"

#include "can/dbc/database.hpp"
#include "can/dbc/signal.hpp"

namespace geoflow::drivers::can::dbc {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr std::string_view kMessage = "BO_ 256 ONE: 8 NODE\n";

std::string error_of(std::string_view text) {
  const auto database = parse(text, "t.dbc");
  EXPECT_FALSE(database) << text;
  return database ? std::string{} : database.error().message;
}

std::string with_signal(std::string_view signal) {
  return fmt::format("{} SG_ {}\n", kMessage, signal);
}

/// Bit i of a DBC: bit i % 8 of byte i / 8.
bool bit(std::span<const std::byte> payload, std::size_t i) {
  return (std::to_integer<unsigned>(payload[i / 8]) >> (i % 8) & 1U) != 0;
}

/// The same field read bit by bit, as the format's description says it.
std::uint64_t reference(std::span<const std::byte> payload, std::size_t start, std::size_t bits,
                        ByteOrder order) {
  std::uint64_t value = 0;
  if (order == ByteOrder::kIntel) {
    for (std::size_t i = bits; i-- > 0;) {
      value = value << 1U | (bit(payload, start + i) ? 1U : 0U);
    }
    return value;
  }
  std::size_t at = start;
  for (std::size_t i = 0; i < bits; ++i) {
    value = value << 1U | (bit(payload, at) ? 1U : 0U);
    at = at % 8 == 0 ? at + 15 : at - 1;  // the sawtooth: on to the next byte's top bit
  }
  return value;
}

TEST(DbcSignal, EveryFieldOfAFrameIsReadAsBitByBit) {
  std::mt19937_64 random{tests::test_seed(1)};
  std::array<std::byte, 12> payload{};
  std::uint64_t fields = 0;
  for (const ByteOrder order : {ByteOrder::kIntel, ByteOrder::kMotorola}) {
    for (std::size_t start = 0; start < payload.size() * 8; ++start) {
      for (std::size_t bits = 1; bits <= 64; ++bits) {
        const auto field = bit_field(start, bits, order, payload.size());
        if (!field) {
          continue;
        }
        for (std::byte& byte : payload) {
          byte = static_cast<std::byte>(random());
        }
        ++fields;
        ASSERT_EQ(read_bits(*field, payload), reference(payload, start, bits, order))
            << start << "|" << bits;
        // Written bits are read back, and no other bit changes.
        const auto before = payload;
        const std::uint64_t value = random();
        write_bits(*field, value, payload);
        const std::uint64_t mask = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
        ASSERT_EQ(read_bits(*field, payload), value & mask);
        write_bits(*field, read_bits(*field, before), payload);
        ASSERT_EQ(payload, before);
      }
    }
  }
  EXPECT_EQ(fields, 2U * (12U * 8U * 64U - 63U * 64U / 2U));
}

TEST(DbcSignal, AFieldOutsideTheMessageIsNone) {
  EXPECT_FALSE(bit_field(0, 0, ByteOrder::kIntel, 8));
  EXPECT_FALSE(bit_field(0, 65, ByteOrder::kIntel, 64));
  EXPECT_FALSE(bit_field(64, 1, ByteOrder::kIntel, 8));
  EXPECT_FALSE(bit_field(57, 8, ByteOrder::kIntel, 8));
  EXPECT_TRUE(bit_field(56, 8, ByteOrder::kIntel, 8));
  EXPECT_FALSE(bit_field(62, 8, ByteOrder::kMotorola, 8));
  EXPECT_TRUE(bit_field(63, 8, ByteOrder::kMotorola, 8));
}

TEST(DbcSignal, EncodingRoundsAndKeepsWithinTheBits) {
  const Signal steps{.field = *bit_field(3, 8, ByteOrder::kIntel, 8),
                     .type = ValueType::kSigned,
                     .factor = 0.5,
                     .offset = 1};
  std::array<std::byte, 8> payload{};
  const auto there_and_back = [&](const Signal& signal, double value) {
    signal.encode(value, payload);
    return signal.decode(payload);
  };
  EXPECT_EQ(there_and_back(steps, 1.6), 1.5);
  EXPECT_EQ(there_and_back(steps, -3.2), -3.0);
  EXPECT_EQ(there_and_back(steps, 1e9), 64.5);
  EXPECT_EQ(there_and_back(steps, -1e9), -63.0);
  EXPECT_EQ(there_and_back(steps, std::nan("")), 1.0);
  const Signal whole{.field = *bit_field(7, 64, ByteOrder::kMotorola, 8),
                     .type = ValueType::kUnsigned};
  EXPECT_EQ(there_and_back(whole, 1e30), std::ldexp(1.0, 64) - 2048);
  const Signal real{.field = *bit_field(0, 32, ByteOrder::kIntel, 8), .type = ValueType::kFloat32};
  EXPECT_EQ(there_and_back(real, -2.25), -2.25);
  EXPECT_FALSE(real.is_plausible(there_and_back(real, std::nan(""))));
}

TEST(Dbc, TheSubsetIsReadAndTheRestPassedOver) {
  const auto database = parse(R"(VERSION ""
NS_ :
	CM_
	BA_
	SIG_VALTYPE_
BS_:
BU_: A B
VAL_TABLE_ States 1 "on;" 0 "off" ;
BO_ 2147484160 BIG: 16 A
 SG_ Mode M : 7|4@0+ (1,0) [0|15] "" B,A
 SG_ Speed m3 : 8|32@1- (1,0) [0|0] "m/s" Vector__XXX
 SG_ Temp m4 : 8|8@1+ (2e-1,-40) [-40|+11] "degC"  B
BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Lost : 0|8@1- (1,0) [0|0] "" Vector__XXX
BO_ 5 SMALL: 0 Vector__XXX
CM_ SG_ 2147484160 Speed "over
two lines; with a semicolon";
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","StandardCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 5 14;
BA_ "BusType" "CAN FD";
SIG_VALTYPE_ 2147484160 Speed : 1;
VAL_ 2147484160 Mode 3 "drive" 4 "warm" ;
)",
                              "t.dbc");
  ASSERT_TRUE(database) << database.error().message;
  ASSERT_EQ(database->messages.size(), 2U);
  const Message& big = database->messages[0];
  EXPECT_EQ(big.id, 512U);
  EXPECT_TRUE(big.extended);
  EXPECT_TRUE(big.fd);  // 16 bytes
  EXPECT_EQ(big.length, 16U);
  EXPECT_EQ(big.line, 9U);
  ASSERT_EQ(big.signals.size(), 3U);
  EXPECT_TRUE(big.signals[0].multiplexor);
  EXPECT_EQ(big.signals[1].multiplexed_by, 3U);
  EXPECT_EQ(big.signals[1].type, ValueType::kFloat32);
  EXPECT_EQ(big.signals[1].unit, "m/s");
  EXPECT_EQ(big.signals[2].factor, 0.2);
  EXPECT_EQ(big.signals[2].offset, -40);
  EXPECT_EQ(big.signals[2].maximum, 11);
  EXPECT_EQ(big.signals[2].line, 12U);
  EXPECT_TRUE(database->messages[1].fd);
  EXPECT_EQ(database->find("SMALL"), &database->messages[1]);
  EXPECT_EQ(database->find("LARGE"), nullptr);
}

TEST(Dbc, ErrorsNameTheLineAndWhatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "t.dbc: has no message"},
      {"\nNONSENSE_ 3 ;", "t.dbc:2: 'NONSENSE_' is no statement"},
      {"7", "t.dbc:1: '7' where a statement begins"},
      {" SG_ a : 0|8@1+ (1,0) [0|0] \"\" X", "t.dbc:1: a signal (SG_) that follows no message"},
      {"BO_ 256 ONE 8 NODE", "t.dbc:1: '8' where ':' is expected"},
      {"BO_ 4096 ONE: 8 NODE", "t.dbc:1: message ONE has an identifier of more than 11 bits"},
      {"BO_ -1 ONE: 8 NODE", "t.dbc:1: '-1' is not a message's identifier"},
      {"BO_ 1 ONE: 65 NODE", "t.dbc:1: message ONE is of 65 bytes"},
      {"BO_ 1 ONE: 8 N\nBO_ 1 TWO: 8 N",
       "t.dbc:2: message TWO has the identifier of ONE in line 1"},
      {with_signal("a : 60|8@1+ (1,0) [0|0] \"\" X"),
       "t.dbc:2: signal a of message ONE: 8 bits from bit 60 on are not within 8 bytes"},
      {with_signal("a : 0|8@2+ (1,0) [0|0] \"\" X"), "byte order 2 is neither 0 nor 1"},
      {with_signal("a : 0|8@1+ (0,0) [0|0] \"\" X"), "its factor is 0"},
      {with_signal("a : 0|8@1+ (nan,0) [0|0] \"\" X"), "t.dbc:2: 'nan' where a factor is expected"},
      {with_signal("a : 0|8@1+ (1e999,0) [0|0] \"\" X"), "'1e999' is not a factor"},
      {with_signal("a : 0|8@1* (1,0) [0|0] \"\" X"), "'*' where '+' is expected"},
      {with_signal("a : 0|8@1+ (1,0) [0|0] \"m X"), "t.dbc:2: a text has no closing quotation"},
      {with_signal("a : 0|8@1+ (1,0) [0|0] \"\""), "the file ends where a receiver is expected"},
      {with_signal("a m1M : 0|8@1+ (1,0) [0|0] \"\" X"), "'m1M' is no multiplexing"},
      {with_signal("a : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ a : 8|8@1+ (1,0) [0|0] \"\" X"),
       "t.dbc:3: signal a of message ONE: is there twice"},
      {with_signal("a M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ b M : 8|8@1+ (1,0) [0|0] \"\" X"),
       "is a second multiplexor"},
      {std::string{kMessage} + "SIG_VALTYPE_ 256 b : 1;", "t.dbc:2: message ONE has no signal b"},
      {with_signal("a : 0|8@1+ (1,0) [0|0] \"\" X\nSIG_VALTYPE_ 256 a : 1;"),
       "t.dbc:3: signal a of 8 bits cannot be of type 1"},
      {std::string{kMessage} + "SIG_VALTYPE_ 257 b : 1;", "t.dbc:2: there is no message 257"},
      {std::string{kMessage} + "BA_ \"VFrameFormat\" BO_ 257 14;", "there is no message 257"},
      {"BO_ 1 ONE: 12 N\nBA_ \"VFrameFormat\" BO_ 1 0;", "t.dbc:2: message ONE is of 12 bytes"},
      {std::string{kMessage} + "SG_MUL_VAL_ 256 a b 1-1;", "extended multiplexing"},
      {std::string{kMessage} + "CM_ \"x\"", "t.dbc:2: a statement has no semicolon"},
      {std::string{kMessage} + std::string{"\0", 1}, "t.dbc:2: a zero byte"},
  };
  for (const auto& [text, expected] : cases) {
    EXPECT_THAT(error_of(text), HasSubstr(expected)) << text;
  }
}

TEST(Dbc, AFileIsReadAndItsAbsenceIsAnError) {
  EXPECT_EQ(load("/nonexistent.dbc").error().code, ErrorCode::kNotFound);
  const tests::TemporaryDirectory directory;
  const auto file = directory.path() / "a.dbc";
  std::ofstream{file} << with_signal("a : 0|8@1+ (1,0) [0|0] \"\" X");
  const auto database = load(file);
  ASSERT_TRUE(database) << database.error().message;
  EXPECT_EQ(database->name, file.string());
  std::filesystem::resize_file(file, (1U << 20U) + 1);
  EXPECT_FALSE(load(file));
}

}  // namespace
}  // namespace geoflow::drivers::can::dbc
