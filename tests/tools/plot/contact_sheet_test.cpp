#include "geoflow/tools/contact_sheet.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <vector>

#include <cairo.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/image.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

/// An image of one colour, or of one depth.
FrameRef uniform(PixelFormat format, const std::vector<std::uint8_t>& pixel) {
  FramePool pool{1};
  FrameRef frame = pool.acquire({.width = kWidth, .height = kHeight, .format = format});
  const auto bytes = frame.writable_bytes();
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = std::byte{pixel[i % pixel.size()]};
  }
  return frame;
}

/// The colour of one pixel of a PNG, 0xRRGGBB.
std::uint32_t pixel_at(const std::filesystem::path& png, int x, int y) {
  cairo_surface_t* surface = cairo_image_surface_create_from_png(png.c_str());
  EXPECT_EQ(cairo_surface_status(surface), CAIRO_STATUS_SUCCESS);
  std::uint32_t value = 0;
  const std::ptrdiff_t stride = cairo_image_surface_get_stride(surface);
  std::memcpy(&value,
              cairo_image_surface_get_data(surface) + y * stride + x * std::ptrdiff_t{sizeof value},
              sizeof value);
  cairo_surface_destroy(surface);
  return value & 0xffffffU;
}

TEST(ContactSheet, HasEachPictureInItsPlaceAndColour) {
  const tests::TemporaryDirectory folder;
  const auto file = folder.path() / "sheet.png";
  const std::vector<SheetImage> images = {
      {.image = uniform(PixelFormat::kBgr8, {255, 0, 0}), .caption = "blue"},
      {.image = uniform(PixelFormat::kRgb8, {255, 0, 0}), .caption = "red"},
      {.image = uniform(PixelFormat::kGray8, {128}), .caption = "gray"},
      {.image = uniform(PixelFormat::kDepth16, {0, 0}), .caption = "nothing measured"}};
  const auto saved = save_contact_sheet(images, {.columns = 2, .tile_width_px = 160}, file);
  ASSERT_TRUE(saved) << saved.error().message;
  // Tiles of 160 x 120 px with a caption of 22 px, 8 px apart.
  EXPECT_EQ(pixel_at(file, 80, 60), 0x0000ffU);
  EXPECT_EQ(pixel_at(file, 250, 60), 0xff0000U);
  EXPECT_EQ(pixel_at(file, 80, 220), 0x808080U);
  EXPECT_EQ(pixel_at(file, 250, 220), 0x000000U);
  EXPECT_EQ(pixel_at(file, 4, 4), 0xffffffU);
}

TEST(ContactSheet, DepthIsColouredByItsRange) {
  const tests::TemporaryDirectory folder;
  const auto color_of = [&](std::uint8_t high_byte, double range_m) {
    const auto file = folder.path() / "depth.png";
    EXPECT_TRUE(save_contact_sheet(
        {{.image = uniform(PixelFormat::kDepth16, {0, high_byte}), .caption = ""}},
        {.tile_width_px = 160, .depth_range_m = range_m}, file));
    return pixel_at(file, 80, 60);
  };
  EXPECT_EQ(color_of(10, 5.12), color_of(5, 2.56));  // half the range either way
  EXPECT_NE(color_of(10, 5.12), color_of(5, 5.12));
}

TEST(ContactSheet, RefusesWhatItCannotDraw) {
  const tests::TemporaryDirectory folder;
  const SheetImage gray{.image = uniform(PixelFormat::kGray8, {1}), .caption = ""};
  EXPECT_THAT(save_contact_sheet({{.image = {}, .caption = "empty"}}, {}, folder.path() / "a.png")
                  .error()
                  .message,
              HasSubstr("'empty'"));
  EXPECT_FALSE(save_contact_sheet({gray}, {}, folder.path() / "a.jpg"));
  EXPECT_FALSE(save_contact_sheet({gray}, {.columns = 0}, folder.path() / "a.png"));
}

}  // namespace
}  // namespace geoflow::tools
