#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "tests/support/data.hpp"

#include "d435i/bytes.hpp"
#include "d435i/golden.hpp"
#include "d435i/uvc/payload.hpp"
#include "d435i/v4l2/v4l2_transport.hpp"
#include "v4l2/iio_sensor.hpp"
#include "v4l2/topology.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

namespace fs = std::filesystem;

/// A sysfs tree as Linux 6.1 shows a D435i on port 1 of bus 2, beside a webcam.
class SysfsTest : public testing::Test {
 protected:
  void SetUp() override {
    add_device("2-1", "0b3a", "850123050307", "5000", "5");
    add_device("1-4", "0825", "webcam", "480", "2");
    add_video("1-4", "1-4:1.0", 0);
    add_video("2-1", "2-1:1.0", 1);
    add_video("2-1", "2-1:1.0", 2);
    add_video("2-1", "2-1:1.0", 9);
    add_video("2-1", "2-1:1.3", 10);
    add_video("2-1", "2-1:1.3", 11);
    add_iio("2-1", "2-1:1.5/0003:8086:0B3A.0001/HID-SENSOR-200073.1.auto", 0, "accel_3d");
    add_iio("2-1", "2-1:1.5/0003:8086:0B3A.0001/HID-SENSOR-200076.2.auto", 3, "gyro_3d");
  }
  static void write(const fs::path& path, std::string_view text) {
    fs::create_directories(path.parent_path());
    std::ofstream{path} << text << '\n';
  }
  [[nodiscard]] fs::path device(const std::string& place) const {
    return root_ / "devices/pci0000:00/usb" / place;
  }
  void link(const fs::path& from, const fs::path& to) const {
    fs::create_directories((root_ / from).parent_path());
    fs::create_directory_symlink(to, root_ / from);
  }
  void add_device(const std::string& place, std::string_view product, std::string_view serial,
                  std::string_view speed, std::string_view number) {
    write(device(place) / "idVendor", "8086");
    write(device(place) / "idProduct", product);
    write(device(place) / "serial", serial);
    write(device(place) / "speed", speed);
    write(device(place) / "busnum", place.substr(0, 1));
    write(device(place) / "devnum", number);
    link(fs::path{"bus/usb/devices"} / place, device(place));
  }
  void add_video(const std::string& place, const std::string& interface, int number) {
    const std::string name = "video" + std::to_string(number);
    const fs::path at = device(place) / interface / "video4linux" / name;
    fs::create_directories(at);
    link(fs::path{"class/video4linux"} / name, at);
  }
  void add_iio(const std::string& place, const std::string& below, int number,
               std::string_view name) {
    const std::string file = "iio:device" + std::to_string(number);
    write(device(place) / below / file / "name", name);
    link(fs::path{"bus/iio/devices"} / file, device(place) / below / file);
  }

  geoflow::tests::TemporaryDirectory folder_;
  fs::path root_ = folder_.path();
};

TEST_F(SysfsTest, FindsTheCamerasNodesByTopology) {
  const auto cameras = v4l2::find_cameras(0x8086, 0x0b3a, root_, "/dev");
  ASSERT_EQ(cameras.size(), 1U);
  const v4l2::UsbCamera& camera = cameras.front();
  EXPECT_EQ(camera.place, "2-1");
  EXPECT_EQ(camera.serial, "850123050307");
  EXPECT_EQ(camera.speed_mbps, 5000);
  EXPECT_EQ(camera.usb_node, "/dev/bus/usb/002/005");
  ASSERT_EQ(camera.video.size(), 5U);
  EXPECT_EQ(camera.video[0].path, "/dev/video1");
  EXPECT_EQ(camera.video[2].number, 9);  // by number, not by name
  EXPECT_EQ(camera.video[2].interface, 0);
  EXPECT_EQ(camera.video[3].number, 10);
  EXPECT_EQ(camera.video[3].interface, 3);
  ASSERT_EQ(camera.iio.size(), 2U);
  EXPECT_EQ(camera.iio[0].name, "accel_3d");
  EXPECT_EQ(camera.iio[1].path, "/dev/iio:device3");
}

TEST_F(SysfsTest, ATreeThatIsNotThereHasNoCameras) {
  EXPECT_TRUE(v4l2::find_cameras(0x8086, 0x0b3a, root_ / "nowhere", "/dev").empty());
  fs::remove_all(device("2-1"));  // it went while it was looked for: a link to nothing
  EXPECT_TRUE(v4l2::find_cameras(0x8086, 0x0b3a, root_, "/dev").empty());
}

TEST(IioScan, TypesAreReadAsTheKernelWritesThem) {
  const auto axis = v4l2::parse_scan_type("le:s16/32>>0");
  ASSERT_TRUE(axis) << axis.error().message;
  EXPECT_FALSE(axis->big_endian);
  EXPECT_TRUE(axis->is_signed);
  EXPECT_EQ(axis->real_bits, 16);
  EXPECT_EQ(axis->storage_bits, 32);
  const auto shifted = v4l2::parse_scan_type("be:u12/16>>4");
  ASSERT_TRUE(shifted);
  EXPECT_TRUE(shifted->big_endian);
  EXPECT_EQ(shifted->shift, 4);
  for (const std::string_view wrong :
       {"", "le:s16/32", "xe:s16/32>>0", "le:s16/33>>0", "le:s40/32>>0", "le:s16/32>>20",
        "le:s0/32>>0", "le:s16/128>>0", "le:s16/32>>0x", "le:f16/32>>0"}) {
    EXPECT_FALSE(v4l2::parse_scan_type(wrong)) << wrong;
  }
}

TEST(IioScan, AScanOfThreeAxesAndTimeHas24Bytes) {
  std::array<v4l2::ScanElement, 4> elements{};
  for (int i = 0; i < 3; ++i) {
    elements.at(static_cast<std::size_t>(i)) = *v4l2::parse_scan_type("le:s16/32>>0");
    elements.at(static_cast<std::size_t>(i)).index = i;
  }
  elements[3] = *v4l2::parse_scan_type("le:s64/64>>0");
  elements[3].index = 3;
  EXPECT_EQ(v4l2::lay_out(elements), 24U);
  EXPECT_EQ(elements[3].offset, 16U);
  // Only the lower 16 bits of an axis' cell are its value.
  const Bytes scan =
      Builder{}.u32(0x0000fc18).u32(0xffff0001).u32(0x7fff).u32(0).u64(123456789).get();
  EXPECT_EQ(v4l2::read_element(elements[0], scan), -1000);
  EXPECT_EQ(v4l2::read_element(elements[1], scan), 1);
  EXPECT_EQ(v4l2::read_element(elements[2], scan), 32767);
  EXPECT_EQ(v4l2::read_element(elements[3], scan), 123456789);
}

TEST(IioScan, BigEndianAndShiftedValuesAreRead) {
  const auto element = v4l2::parse_scan_type("be:s12/16>>4");
  ASSERT_TRUE(element);
  EXPECT_EQ(v4l2::read_element(*element, from_hex("ff f0")), -1);
  EXPECT_EQ(v4l2::read_element(*element, from_hex("7f f3")), 2047);
  EXPECT_EQ(v4l2::read_element(*v4l2::parse_scan_type("le:u8/8>>0"), from_hex("ff")), 255);
}

TEST(V4l2Metadata, TheHeaderStandsBehindTheHostsStamp) {
  const Bytes header = golden_depth_header(77, 5);
  const Bytes whole = Builder{}.zeros(10).bytes(header).get();
  EXPECT_EQ(header_in_metadata(whole), header);
  // 'UVCH': the kernel keeps 12 bytes of a header that says it has 232.
  const Bytes standard(whole.begin(), whole.begin() + 22);
  const auto found = parse_payload_header(header_in_metadata(standard));
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(found->pts_us, 77U);
  EXPECT_TRUE(found->metadata.empty());
  EXPECT_TRUE(header_in_metadata(Bytes(10)).empty());
  EXPECT_TRUE(header_in_metadata({}).empty());
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
