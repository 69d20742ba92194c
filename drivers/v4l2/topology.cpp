#include "v4l2/topology.hpp"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace geoflow::drivers::v4l2 {
namespace {

namespace fs = std::filesystem;

constexpr int kDecimal = 10;
constexpr int kHexadecimal = 16;

std::string read_line(const fs::path& path) {
  std::ifstream file{path};
  std::string line;
  std::getline(file, line);
  return line;
}

std::optional<int> number(std::string_view text, int base) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  const bool whole = error == std::errc{} && end == text.data() + text.size();
  return whole ? std::optional{value} : std::nullopt;
}

/// The entries of a folder in order of their names; none where it cannot be read.
std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> all;
  std::error_code error;
  for (fs::directory_iterator at{folder, error}; !error && at != fs::directory_iterator{};
       at.increment(error)) {
    all.push_back(at->path());
  }
  std::ranges::sort(all);
  return all;
}

/// Whether `path` lies inside `folder`, both without links.
bool is_inside(const fs::path& path, const fs::path& folder) {
  const auto [in_folder, in_path] =
      std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return in_folder == folder.end();
}

/// The interface's number in a path "…/2-1/2-1:1.3/…".
std::optional<int> interface_in(const fs::path& path, const std::string& place) {
  const std::string prefix = place + ":";
  for (const fs::path& part : path) {
    const std::string text = part.string();
    const auto dot = text.rfind('.');
    if (text.starts_with(prefix) && dot != std::string::npos) {
      return number(std::string_view{text}.substr(dot + 1), kDecimal);
    }
  }
  return std::nullopt;
}

std::vector<VideoNode> video_nodes(const UsbCamera& camera, const fs::path& device,
                                   const fs::path& sysfs, const fs::path& dev) {
  constexpr std::string_view kPrefix = "video";
  std::vector<VideoNode> nodes;
  for (const fs::path& entry : entries(sysfs / "class/video4linux")) {
    const std::string name = entry.filename().string();
    std::error_code error;
    const fs::path real = fs::canonical(entry, error);
    if (error || !name.starts_with(kPrefix) || !is_inside(real, device)) {
      continue;
    }
    const auto its_number = number(std::string_view{name}.substr(kPrefix.size()), kDecimal);
    const auto interface = interface_in(real, camera.place);
    if (its_number && interface) {
      nodes.push_back({.path = dev / name, .number = *its_number, .interface = *interface});
    }
  }
  std::ranges::sort(nodes, {}, &VideoNode::number);
  return nodes;
}

std::vector<IioNode> iio_nodes(const fs::path& device, const fs::path& sysfs, const fs::path& dev) {
  std::vector<IioNode> nodes;
  for (const fs::path& entry : entries(sysfs / "bus/iio/devices")) {
    const std::string file = entry.filename().string();
    std::error_code error;
    const fs::path real = fs::canonical(entry, error);
    if (!error && file.starts_with("iio:device") && is_inside(real, device)) {
      nodes.push_back({.sysfs = real, .path = dev / file, .name = read_line(real / "name")});
    }
  }
  std::ranges::sort(nodes, {}, &IioNode::name);
  return nodes;
}

}  // namespace

std::vector<UsbCamera> find_cameras(std::uint16_t vendor, std::uint16_t product,
                                    const fs::path& sysfs, const fs::path& dev) {
  std::vector<UsbCamera> cameras;
  for (const fs::path& entry : entries(sysfs / "bus/usb/devices")) {
    std::error_code error;
    const fs::path device = fs::canonical(entry, error);
    if (error || number(read_line(device / "idVendor"), kHexadecimal) != int{vendor} ||
        number(read_line(device / "idProduct"), kHexadecimal) != int{product}) {
      continue;
    }
    UsbCamera camera{.place = entry.filename().string(),
                     .serial = read_line(device / "serial"),
                     .speed_mbps = number(read_line(device / "speed"), kDecimal).value_or(0)};
    const auto bus = number(read_line(device / "busnum"), kDecimal);
    const auto address = number(read_line(device / "devnum"), kDecimal);
    if (bus && address) {
      camera.usb_node = dev / fmt::format("bus/usb/{:03}/{:03}", *bus, *address);
    }
    camera.video = video_nodes(camera, device, sysfs, dev);
    camera.iio = iio_nodes(device, sysfs, dev);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace geoflow::drivers::v4l2
