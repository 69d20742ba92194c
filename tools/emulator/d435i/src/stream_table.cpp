#include "src/stream_table.hpp"

#include <array>
#include <cstdint>
#include <span>

namespace geoflow::emulator {
namespace {

// Frame intervals [100 ns].
constexpr std::array<std::uint32_t, 5> kFrom90To6{111111, 166666, 333333, 666666, 1666665};
constexpr std::array<std::uint32_t, 4> kFrom60To6{166666, 333333, 666666, 1666665};
constexpr std::array<std::uint32_t, 3> kFrom30To6{333333, 666666, 1666665};
constexpr std::array<std::uint32_t, 3> k60And30And6{166666, 333333, 1666665};
constexpr std::array<std::uint32_t, 2> k300And90{33333, 111111};
constexpr std::array<std::uint32_t, 2> k300And100{33333, 100000};
constexpr std::array<std::uint32_t, 2> k30And15{333333, 666666};
constexpr std::array<std::uint32_t, 2> k25And15{400000, 666666};
constexpr std::array<std::uint32_t, 1> k30{333333};

// NOLINTBEGIN(modernize-use-designated-initializers): tables, in the order of their structs'
// members NOLINTBEGIN(readability-magic-numbers): GUIDs

// The pair of grays has one size more than the others.
constexpr std::array<FrameSize, 9> kStereoSizes{{{256, 144, k300And90},
                                                 {424, 240, kFrom90To6},
                                                 {480, 270, kFrom90To6},
                                                 {640, 360, kFrom90To6},
                                                 {640, 480, kFrom90To6},
                                                 {848, 100, k300And100},
                                                 {848, 480, kFrom90To6},
                                                 {1280, 720, kFrom30To6},
                                                 {1280, 800, k30And15}}};
constexpr auto kDepthSizes = std::span{kStereoSizes}.first<8>();
constexpr std::array<FrameSize, 2> kCalibrationSizes{{{640, 400, k25And15}, {1280, 800, k25And15}}};
constexpr std::array<FrameSize, 9> kColorSizes{{{320, 180, k60And30And6},
                                                {320, 240, k60And30And6},
                                                {424, 240, kFrom60To6},
                                                {640, 360, kFrom60To6},
                                                {640, 480, kFrom60To6},
                                                {848, 480, kFrom60To6},
                                                {960, 540, kFrom60To6},
                                                {1280, 720, kFrom30To6},
                                                {1920, 1080, kFrom30To6}}};
constexpr std::array<FrameSize, 1> kRawSizes{{{1920, 1080, k30}}};

using Guid = std::array<std::uint8_t, 16>;

/// The media subtype of a four-character code or a Direct3D format number.
constexpr Guid subtype(std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) {
  return {a, b, c, d, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71};
}
constexpr Guid kD16 = subtype(0x50, 0, 0, 0);
constexpr Guid kL8 = subtype(0x32, 0, 0, 0);
/// Realtek's own, "RW16".
constexpr Guid kRw16{0x52, 0x57, 0x31, 0x36, 0x66, 0x1a, 0x42, 0xa2,
                     0x90, 0x65, 0xd0, 0x18, 0x14, 0xa8, 0xef, 0x8a};

constexpr std::array<VideoFormat, 2> kDepthFormats{
    {{subtype('Z', '1', '6', ' '), 16, Packing::kDepth, 1, kDepthSizes},
     {kD16, 16, Packing::kDepth, 2, kDepthSizes}}};
constexpr std::array<VideoFormat, 5> kInfraredFormats{
    {{kL8, 8, Packing::kGray, 1, kDepthSizes},
     {subtype('U', 'Y', 'V', 'Y'), 16, Packing::kUyvy, 2, kDepthSizes},
     {subtype('Y', '8', ' ', ' '), 8, Packing::kGray, 1, kDepthSizes},
     {subtype('Y', '8', 'I', ' '), 16, Packing::kGrayPair, 3, kStereoSizes},
     {subtype('Y', '1', '2', 'I'), 24, Packing::kGrayPair12, 4, kCalibrationSizes}}};
constexpr std::array<VideoFormat, 2> kColorFormats{
    {{subtype('Y', 'U', 'Y', '2'), 16, Packing::kYuyv, 1, kColorSizes},
     {kRw16, 16, Packing::kBayer, 2, kRawSizes}}};

constexpr std::array<VideoInterface, kVideoStreamCount> kInterfaces{
    {{1, 0x82, 5, 4, kDepthFormats},
     {2, 0x83, 8, 5, kInfraredFormats},
     {4, 0x84, 6, 9, kColorFormats}}};

// NOLINTEND(readability-magic-numbers)
// NOLINTEND(modernize-use-designated-initializers)

}  // namespace

std::span<const VideoInterface, kVideoStreamCount> video_interfaces() noexcept {
  return kInterfaces;
}

}  // namespace geoflow::emulator
