#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include <gtest/gtest.h>

#include "d435i/bytes.hpp"
#include "d435i/golden.hpp"
#include "d435i/uvc/descriptors.hpp"
#include "d435i/uvc/metadata.hpp"
#include "d435i/uvc/payload.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

TEST(ConfigurationDescriptor, GoldenOneHasThePublishedLength) {
  EXPECT_EQ(golden_configuration().size(), 3199U);
}

TEST(ConfigurationDescriptor, TellsInterfacesAndEndpoints) {
  const auto found = parse_configuration(golden_configuration());
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->controls.size(), 2U);
  EXPECT_EQ(found->controls[0].number, 0);
  EXPECT_EQ(found->controls[0].uvc_version, 0x0150);
  EXPECT_EQ(found->controls[0].streaming, (std::vector<std::uint8_t>{1, 2}));
  EXPECT_EQ(found->controls[1].streaming, (std::vector<std::uint8_t>{4}));
  ASSERT_EQ(found->streams.size(), 3U);
  EXPECT_EQ(found->streams[0].endpoint, 0x82);
  EXPECT_EQ(found->streams[0].max_packet, 1024);
  EXPECT_TRUE(found->streams[0].bulk);
  EXPECT_EQ(found->streams[2].number, 4);
  EXPECT_EQ(found->streams[2].endpoint, 0x84);
  EXPECT_EQ(found->streams[2].terminal_link, 9);
  ASSERT_TRUE(found->hid);
  EXPECT_EQ(found->hid->number, 5);
  EXPECT_EQ(found->hid->endpoint, 0x86);
  EXPECT_EQ(found->hid->report_descriptor_bytes, 1000);
  EXPECT_EQ(found->configuration, 1);
}

TEST(ConfigurationDescriptor, TellsTheExtensionUnitsSelectors) {
  const auto found = parse_configuration(golden_configuration());
  ASSERT_TRUE(found);
  ASSERT_EQ(found->controls[0].extension_units.size(), 1U);
  const ExtensionUnit& unit = found->controls[0].extension_units[0];
  EXPECT_EQ(unit.id, 3);
  for (const int selector : {1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 15, 16}) {
    EXPECT_TRUE(unit.has(static_cast<std::uint8_t>(selector))) << selector;
  }
  for (const int selector : {0, 10, 14, 17, 24, 25, 255}) {
    EXPECT_FALSE(unit.has(static_cast<std::uint8_t>(selector))) << selector;
  }
}

TEST(ConfigurationDescriptor, ListsTheModesOfThePublishedTable) {
  const auto found = parse_configuration(golden_configuration());
  ASSERT_TRUE(found);
  const auto modes = list_modes(*found);
  EXPECT_EQ(describe_modes(modes, PixelCoding::kZ16),
            "256x144 at 300/90 Hz, 424x240 at 90/60/30/15/6 Hz, 480x270 at 90/60/30/15/6 Hz, "
            "640x360 at 90/60/30/15/6 Hz, 640x480 at 90/60/30/15/6 Hz, 848x100 at 300/100 Hz, "
            "848x480 at 90/60/30/15/6 Hz, 1280x720 at 30/15/6 Hz");
  EXPECT_EQ(std::ranges::count(modes, PixelCoding::kYuyv, &VideoMode::coding), 32);
}

TEST(ConfigurationDescriptor, ChoosesAModeByItsNumbers) {
  const auto found = parse_configuration(golden_configuration());
  ASSERT_TRUE(found);
  const auto depth = choose_mode(*found, {PixelCoding::kZ16, 848, 480, 30});
  ASSERT_TRUE(depth) << depth.error().message;
  EXPECT_EQ(depth->interface, 1);
  EXPECT_EQ(depth->format_index, 1);
  EXPECT_EQ(depth->frame_index, 7);
  EXPECT_EQ(depth->interval_100ns, 333333U);
  EXPECT_EQ(depth->frame_bytes, 848U * 480 * 2);
  const auto color = choose_mode(*found, {PixelCoding::kYuyv, 640, 480, 15});
  ASSERT_TRUE(color);
  EXPECT_EQ(color->endpoint, 0x84);
  EXPECT_EQ(color->frame_index, 5);
}

TEST(ConfigurationDescriptor, SaysWhichModesAUsb2LinkHas) {
  const auto found = parse_configuration(usb2_configuration());
  ASSERT_TRUE(found);
  const auto none = choose_mode(*found, {PixelCoding::kZ16, 848, 480, 30});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().message,
            "the camera has no depth of 848x480 at 30 Hz on this link; it has 480x270 at "
            "60/30/15/6 Hz, 640x480 at 30/15/6 Hz, 1280x720 at 6 Hz");
}

TEST(ConfigurationDescriptor, AModeOfGigabytesIsRefused) {
  auto found = parse_configuration(golden_configuration());
  ASSERT_TRUE(found);
  UvcFormat& format = found->streams.front().formats.front();
  UvcFrame& frame = format.frames.front();
  frame.width = 64896;
  frame.height = 65055;
  const auto refused = choose_mode(
      *found, {format.coding, frame.width, frame.height, rate_of(frame.intervals_100ns.front())});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidData);
  EXPECT_EQ(refused.error().message,
            "format 1, frame 1 of the camera's descriptors: 64896x65055 at 16 bits a pixel are "
            "8443618560 bytes; no mode of this camera has more than 16588800");
}

TEST(ConfigurationDescriptor, CutAnywhereIsRefusedOrShort) {
  const Bytes whole = golden_configuration();
  std::size_t refused = 0;
  for (std::size_t size = 1; size < whole.size(); ++size) {
    const auto found = parse_configuration(std::span{whole}.first(size));
    refused += found ? 0U : 1U;
    EXPECT_TRUE(found || !found.error().message.empty());
  }
  EXPECT_GT(refused, whole.size() * 9 / 10);
}

TEST(ConfigurationDescriptor, ADescriptorShorterThanItsKindNamesItsByte) {
  EXPECT_FALSE(parse_configuration(from_hex("09 02 20 00 01 01 00 80 32  03 04 00")));
  const auto cut = parse_configuration(
      from_hex("09 02 20 00 01 01 00 80 32  09 04 00 00 01 0e 01 00 00  05 24 01 50 01"));
  ASSERT_FALSE(cut);
  EXPECT_NE(cut.error().message.find("byte 18"), std::string::npos) << cut.error().message;
}

TEST(PayloadHeader, ReadsTheCamerasOwn) {
  const Bytes bytes = golden_depth_header(4'000'000'000U, 77);
  ASSERT_EQ(bytes.size(), 232U);
  const auto header = parse_payload_header(bytes);
  ASSERT_TRUE(header) << header.error().message;
  EXPECT_EQ(header->length, 232);
  EXPECT_TRUE(header->frame_id);
  EXPECT_TRUE(header->end_of_frame);
  EXPECT_FALSE(header->error);
  EXPECT_EQ(header->pts_us, 4'000'000'000U);
  EXPECT_EQ(header->metadata.size(), 220U);
}

TEST(PayloadHeader, ReadsWhatTheFlagsSayIsThere) {
  const auto bare = parse_payload_header(from_hex("02 80"));
  ASSERT_TRUE(bare);
  EXPECT_FALSE(bare->pts_us);
  const auto failed = parse_payload_header(from_hex("06 c6 01 00 00 00"));
  ASSERT_TRUE(failed);
  EXPECT_TRUE(failed->error);
  EXPECT_EQ(failed->pts_us, 1U);
}

TEST(PayloadHeader, RefusesLengthsThatCannotBe) {
  EXPECT_FALSE(parse_payload_header({}));
  EXPECT_FALSE(parse_payload_header(from_hex("02")));
  EXPECT_FALSE(parse_payload_header(from_hex("01 80")));
  EXPECT_FALSE(parse_payload_header(from_hex("0c 8e 00 00")));                 // more than there is
  EXPECT_FALSE(parse_payload_header(from_hex("05 84 00 00 00 00 00 00 00")));  // PTS does not fit
}

TEST(Metadata, ReadsTheBlocksOfADepthFrame) {
  const Bytes bytes = golden_depth_header(1, 4711);
  const auto header = parse_payload_header(bytes);
  ASSERT_TRUE(header);
  const auto metadata = parse_metadata(header->metadata);
  ASSERT_TRUE(metadata) << metadata.error().message;
  ASSERT_TRUE(metadata->timing);
  EXPECT_EQ(metadata->timing->frame_counter, 4711U);
  EXPECT_EQ(metadata->timing->optical_time_us, 4250U);
  EXPECT_EQ(metadata->timing->exposure_us, 8500U);
  EXPECT_EQ(metadata->timing->frame_interval_us, 33333U);
  ASSERT_TRUE(metadata->depth);
  EXPECT_EQ(metadata->depth->gain, 16U);
  EXPECT_EQ(metadata->depth->laser_power, 150U);
  ASSERT_TRUE(metadata->configuration);
  EXPECT_EQ(metadata->configuration->width, 848);
  EXPECT_EQ(metadata->configuration->height, 480);
  EXPECT_EQ(metadata->configuration->rate_hz, 30);
}

TEST(Metadata, LeavesOutWhatItsFlagsDoNotMark) {
  const auto metadata = parse_metadata(
      Builder{}.u32(0x80000001).u32(40).u32(1).u32(0x02).u32(5).u32(6).zeros(16).get());
  ASSERT_TRUE(metadata);
  ASSERT_TRUE(metadata->timing);
  EXPECT_FALSE(metadata->timing->frame_counter);
  EXPECT_EQ(metadata->timing->optical_time_us, 6U);
  EXPECT_FALSE(metadata->depth);
}

TEST(Metadata, PassesOverUnknownBlocksAndRefusesBrokenOnes) {
  EXPECT_TRUE(parse_metadata({}));
  EXPECT_TRUE(parse_metadata(Builder{}.u32(0x80000099).u32(12).u32(0).get()));
  EXPECT_FALSE(parse_metadata(Builder{}.u32(0x80000099).u32(7).get()));
  EXPECT_FALSE(parse_metadata(Builder{}.u32(0x80000099).u32(9).get()));
  EXPECT_FALSE(parse_metadata(Builder{}.u32(0x80000001).u32(20).u32(1).u32(0x3f).u32(9).get()));
  EXPECT_FALSE(parse_metadata(from_hex("01 00")));
}

TEST(ProbeCommit, AsksInTheLengthOfItsVersion) {
  const ModeChoice choice{.interface = 1,
                          .endpoint = 0x82,
                          .format_index = 1,
                          .frame_index = 7,
                          .interval_100ns = 333333,
                          .frame_bytes = 814080};
  const Bytes block = encode_probe(choice, 0x0150);
  EXPECT_EQ(block, Builder{}.hex("01 00 01 07 15 16 05 00").zeros(40).get());
  EXPECT_EQ(encode_probe(choice, 0x0110).size(), 34U);
  EXPECT_EQ(encode_probe(choice, 0x0100).size(), 26U);
}

TEST(ProbeCommit, ReadsTheCamerasAnswer) {
  const Bytes block = Builder{}
                          .hex("01 00 01 07 15 16 05 00")
                          .zeros(10)
                          .u32(814080)
                          .u32(814080 + 255)
                          .zeros(22)
                          .get();
  const auto probe = parse_probe(block);
  ASSERT_TRUE(probe) << probe.error().message;
  EXPECT_EQ(probe->frame_index, 7);
  EXPECT_EQ(probe->interval_100ns, 333333U);
  EXPECT_EQ(probe->max_frame_bytes, 814080U);
  EXPECT_EQ(probe->max_payload_bytes, 814335U);
  EXPECT_FALSE(parse_probe(std::span{block}.first(25)));
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
