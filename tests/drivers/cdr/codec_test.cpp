#include "replay/cdr/codec.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "geoflow/hal/result.hpp"

#include "cdr/random_messages.hpp"
#include "replay/cdr/messages.hpp"

namespace geoflow::drivers {
namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

/// Writes messages with Fast-CDR, the library under ROS 2's default middleware: what a recording
/// holds.
class FastCdrOracle {
 public:
  explicit FastCdrOracle(Cdr::Endianness endianness) : cdr_{buffer_, endianness, Cdr::DDS_CDR} {
    cdr_.serialize_encapsulation();
  }

  template <typename T>
  void write(const T& value) {
    if constexpr (std::is_arithmetic_v<T>) {
      cdr_ << value;
    } else {
      std::apply([this](const auto&... member) { (this->write(member), ...); }, T::fields(value));
    }
  }
  // Fast-CDR cannot write a string with a zero inside; the wire can.
  void write(const std::string& text) {
    write(std::as_bytes(std::span{text.c_str(), text.size() + 1}));
  }
  void write(std::span<const std::byte> bytes) {
    cdr_ << static_cast<std::uint32_t>(bytes.size());
    for (const std::byte byte : bytes) {
      cdr_ << std::to_integer<std::uint8_t>(byte);
    }
  }
  template <typename T>
  void write(const std::vector<T>& values) {
    cdr_ << static_cast<std::uint32_t>(values.size());
    for (const T& value : values) {
      write(value);
    }
  }
  template <typename T, std::size_t Size>
  void write(const std::array<T, Size>& values) {
    for (const T& value : values) {
      write(value);
    }
  }

  std::vector<std::byte> bytes() {
    const auto whole =
        std::as_bytes(std::span{buffer_.getBuffer(), cdr_.getSerializedDataLength()});
    return {whole.begin(), whole.end()};
  }

 private:
  static constexpr std::size_t kRoomBytes = std::size_t{1} << 20;
  std::vector<char> memory_ =
      std::vector<char>(kRoomBytes);  // zeroed: Fast-CDR leaves padding as it finds it
  FastBuffer buffer_{memory_.data(), memory_.size()};
  Cdr cdr_;
};

template <typename Message>
std::vector<std::byte> by_fast_cdr(const Message& message, Cdr::Endianness endianness) {
  FastCdrOracle oracle{endianness};
  oracle.write(message);
  return oracle.bytes();
}

template <typename Message>
class CodecTest : public testing::Test {};

using Messages = testing::Types<ros::Header, ros::Image, ros::CompressedImage, ros::CameraInfo,
                                ros::Imu, ros::JointState, ros::Odometry, ros::TfMessage>;
TYPED_TEST_SUITE(CodecTest, Messages);

TYPED_TEST(CodecTest, WritesTheBytesThatFastCdrWrites) {
  EXPECT_TRUE(rc::check([] {
    test::RandomMessages random;
    const auto message = random.make<TypeParam>();
    RC_ASSERT(cdr::encode(message) == by_fast_cdr(message, Cdr::LITTLE_ENDIANNESS));
  }));
}

TYPED_TEST(CodecTest, ReadsBothByteOrdersBitExactly) {
  EXPECT_TRUE(rc::check([] {
    test::RandomMessages random;
    const auto message = random.make<TypeParam>();
    const auto little = by_fast_cdr(message, Cdr::LITTLE_ENDIANNESS);
    const auto big = by_fast_cdr(message, Cdr::BIG_ENDIANNESS);

    const auto from_little = cdr::decode<TypeParam>(little);
    const auto from_big = cdr::decode<TypeParam>(big);

    RC_ASSERT(from_little.has_value());
    RC_ASSERT(from_big.has_value());
    RC_ASSERT(cdr::encode(*from_little) == little);
    RC_ASSERT(cdr::encode(*from_big) == little);
  }));
}

TYPED_TEST(CodecTest, MessageCutAnywhereIsAnErrorThatNamesTheType) {
  EXPECT_TRUE(rc::check([] {
    test::RandomMessages random;
    const auto whole = cdr::encode(random.make<TypeParam>());
    for (std::size_t size = 0; size < whole.size(); ++size) {
      // A copy of its own, so that the address sanitiser sees a read past the cut.
      const std::vector<std::byte> cut{whole.begin(),
                                       whole.begin() + static_cast<std::ptrdiff_t>(size)};
      const auto message = cdr::decode<TypeParam>(cut);
      RC_ASSERT_FALSE(message.has_value());
      RC_ASSERT(message.error().code == ErrorCode::kInvalidData);
      RC_ASSERT(message.error().message.find(TypeParam::kType) != std::string::npos);
    }
  }));
}

TYPED_TEST(CodecTest, PaddingAtTheEndIsAcceptedAndAnotherMessagesTailIsNot) {
  EXPECT_TRUE(rc::check([] {
    test::RandomMessages random;
    auto bytes = cdr::encode(random.make<TypeParam>());
    bytes.resize(bytes.size() + *rc::gen::inRange<std::size_t>(0, 8));
    RC_ASSERT(cdr::decode<TypeParam>(bytes).has_value());
    bytes.resize(bytes.size() + 8);
    RC_ASSERT_FALSE(cdr::decode<TypeParam>(bytes).has_value());
  }));
}

TYPED_TEST(CodecTest, AnyBytesAreReadOrRefusedWithoutHarm) {
  EXPECT_TRUE(rc::check([] {
    test::RandomMessages random;
    auto bytes = cdr::encode(random.make<TypeParam>());
    const auto count = *rc::gen::inRange(1, 8);
    for (int i = 0; i < count; ++i) {
      bytes[*rc::gen::inRange<std::size_t>(0, bytes.size())] =
          std::byte{*rc::gen::arbitrary<std::uint8_t>()};
    }
    if (const auto message = cdr::decode<TypeParam>(bytes)) {
      RC_ASSERT(cdr::encode(*message).size() <= bytes.size() + 8);
    }
  }));
}

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) {
    bytes.push_back(static_cast<std::byte>(value));
  }
  return bytes;
}

TEST(Codec, HeaderHasTheBytesOfTheSpecification) {
  const ros::Header header{.stamp = {.sec = 1, .nanosec = 0x01020304}, .frame_id = "cam"};
  EXPECT_EQ(cdr::encode(header),
            bytes_of({0, 1, 0, 0, 1, 0, 0, 0, 4, 3, 2, 1, 4, 0, 0, 0, 'c', 'a', 'm', 0}));
}

TEST(Codec, ValuesAreAlignedFromTheEndOfTheEncapsulationHeader) {
  // A frame id of 1 character ends at byte 18 + 4; the next double stands at 24 + 4, not at 24.
  ros::JointState joints;
  joints.header.frame_id = "a";
  joints.position = {1.0};
  const auto bytes = cdr::encode(joints);
  // header: 8 + 4 + 2, pad to 16: name length 0, position length 1, then the double at 24.
  ASSERT_GE(bytes.size(), 36U);
  EXPECT_EQ(std::to_integer<int>(bytes[4 + 20]), 1);
  EXPECT_EQ(std::to_integer<int>(bytes[4 + 24 + 7]), 0x3f);
}

TEST(Codec, HugeLengthIsRefusedBeforeAnythingIsAllocated) {
  const auto hostile = bytes_of({0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0});
  const auto message = cdr::decode<ros::TfMessage>(hostile);
  ASSERT_FALSE(message.has_value());
  EXPECT_EQ(message.error().message,
            "tf2_msgs/msg/TFMessage: a sequence of 4294967295 elements at byte 4 is longer than "
            "the rest of the CDR "
            "message, 4 bytes");
}

TEST(Codec, OtherRepresentationsAreRefusedByName) {
  for (const int identifier : {2, 3, 6, 7, 11}) {
    const auto message = cdr::decode<ros::Header>(
        bytes_of({0, identifier, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0}));
    ASSERT_FALSE(message.has_value());
    EXPECT_NE(message.error().message.find("is not plain CDR"), std::string::npos)
        << message.error().message;
  }
}

TEST(Codec, StringWithoutItsZeroIsRefusedAndAnEmptyOneOfLengthZeroIsNot) {
  EXPECT_FALSE(
      cdr::decode<ros::Header>(bytes_of({0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 'x'}))
          .has_value());
  const auto header =
      cdr::decode<ros::Header>(bytes_of({0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
  ASSERT_TRUE(header.has_value()) << header.error().message;
  EXPECT_EQ(header->frame_id, "");
}

}  // namespace
}  // namespace geoflow::drivers
