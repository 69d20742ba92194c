#include "v4l2/iio_sensor.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "v4l2/topology.hpp"

namespace geoflow::drivers::v4l2 {
namespace {

namespace fs = std::filesystem;

constexpr int kByteBits = 8;
constexpr int kMostBits = 64;
constexpr int kKernelBuffer = 64;  // scans that may wait in the kernel
constexpr std::size_t kReadScans = 32;

Result<void> write_file(const fs::path& path, std::string_view text) {
  const UniqueFd fd{::open(path.c_str(), O_WRONLY | O_CLOEXEC)};
  if (!fd || ::write(fd.get(), text.data(), text.size()) < 0) {
    const int number = errno;
    return fail(number == ENOENT || number == ENODEV ? ErrorCode::kNotFound : ErrorCode::kSystem,
                "{}: cannot be written: {}{}", path.string(),
                std::system_category().message(number),
                number == EACCES ? "; udev/60-geoflow.rules gives access to it" : "");
  }
  return {};
}

std::string read_line(const fs::path& path) {
  std::ifstream file{path};
  std::string line;
  std::getline(file, line);
  return line;
}

/// Takes a whole number off the front of `text`.
bool take_number(std::string_view& text, int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return error == std::errc{};
}

bool take_text(std::string_view& text, std::string_view expected) {
  const bool there = text.starts_with(expected);
  text.remove_prefix(there ? expected.size() : 0);
  return there;
}

/// The names of a sensor's channels: in_accel_x, …
std::array<std::string, 4> channels(std::string_view name) {
  const std::string_view kind = name.starts_with("accel") ? "in_accel" : "in_anglvel";
  return {fmt::format("{}_x", kind), fmt::format("{}_y", kind), fmt::format("{}_z", kind),
          "in_timestamp"};
}

Result<ScanElement> read_scan_element(const fs::path& folder, const std::string& channel) {
  auto element = parse_scan_type(read_line(folder / (channel + "_type")));
  if (!element) {
    return tl::unexpected{std::move(element.error()).in((folder / channel).string())};
  }
  const std::string index = read_line(folder / (channel + "_index"));
  std::string_view left = index;
  if (!take_number(left, element->index)) {
    return fail(ErrorCode::kInvalidData, "{}_index: '{}' is no number", (folder / channel).string(),
                index);
  }
  return element;
}

}  // namespace

Result<ScanElement> parse_scan_type(std::string_view text) {
  const std::string_view whole = text;
  ScanElement element;
  element.big_endian = take_text(text, "be:");
  const bool ordered = element.big_endian || take_text(text, "le:");
  element.is_signed = take_text(text, "s");
  const bool sign = element.is_signed || take_text(text, "u");
  const bool read = ordered && sign && take_number(text, element.real_bits) &&
                    take_text(text, "/") && take_number(text, element.storage_bits) &&
                    take_text(text, ">>") && take_number(text, element.shift) && text.empty();
  const bool sizes = element.storage_bits > 0 && element.storage_bits <= kMostBits &&
                     element.storage_bits % kByteBits == 0 && element.real_bits > 0 &&
                     element.shift >= 0 &&
                     element.real_bits + element.shift <= element.storage_bits;
  if (!read || !sizes) {
    return fail(ErrorCode::kInvalidData, "'{}' is no type of a scan element", whole);
  }
  return element;
}

std::size_t lay_out(std::span<ScanElement> elements) {
  std::vector<ScanElement*> in_order;
  for (ScanElement& element : elements) {
    in_order.push_back(&element);
  }
  std::ranges::sort(in_order, {}, &ScanElement::index);
  std::size_t end = 0;
  std::size_t largest = 1;
  const auto aligned = [](std::size_t at, std::size_t size) {
    return (at + size - 1) / size * size;
  };
  for (ScanElement* element : in_order) {
    const auto size = static_cast<std::size_t>(element->storage_bits / kByteBits);
    element->offset = aligned(end, size);
    end = element->offset + size;
    largest = std::max(largest, size);
  }
  return aligned(end, largest);
}

std::int64_t read_element(const ScanElement& element, std::span<const std::byte> scan) {
  const auto size = static_cast<std::size_t>(element.storage_bits / kByteBits);
  const auto bytes = scan.subspan(element.offset, size);
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const std::byte byte = bytes[element.big_endian ? i : size - 1 - i];
    value = value << unsigned{kByteBits} | std::to_integer<std::uint64_t>(byte);
  }
  // The real bits go to the top, and come back with their sign or without.
  const auto above = static_cast<unsigned>(kMostBits - element.real_bits - element.shift);
  const auto beside = static_cast<unsigned>(kMostBits - element.real_bits);
  const std::uint64_t top = value << above;
  return element.is_signed ? static_cast<std::int64_t>(top) >> beside
                           : static_cast<std::int64_t>(top >> beside);
}

Result<std::unique_ptr<IioSensor>> IioSensor::start(const IioNode& node, int rate_code) {
  const fs::path scan = node.sysfs / "scan_elements";
  // A buffer that is on cannot be set up; one that is off does not mind.
  (void)write_file(node.sysfs / "buffer/enable", "0");
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  std::unique_ptr<IioSensor> sensor{new IioSensor{node, UniqueFd{}}};
  const auto names = channels(node.name);
  for (std::size_t i = 0; i < names.size(); ++i) {
    auto element = read_scan_element(scan, names.at(i));
    if (!element) {
      return tl::unexpected{std::move(element.error())};
    }
    sensor->axes_.at(i) = *element;
    if (auto done = write_file(scan / (names.at(i) + "_en"), "1"); !done) {
      return tl::unexpected{std::move(done.error())};
    }
  }
  sensor->scan_bytes_ = lay_out(sensor->axes_);
  const std::string_view kind = node.name.starts_with("accel") ? "accel" : "anglvel";
  const auto number = node.sysfs.filename().string().substr(std::string_view{"iio:device"}.size());
  auto done =
      write_file(node.sysfs / fmt::format("in_{}_sampling_frequency", kind),
                 fmt::format("{}", rate_code))
          .and_then([&] {
            return write_file(node.sysfs / "buffer/length", fmt::format("{}", kKernelBuffer));
          });
  // Newer kernels set the trigger themselves.
  (void)write_file(node.sysfs / "trigger/current_trigger",
                   fmt::format("{}-dev{}", node.name, number));
  if (!done) {
    return tl::unexpected{std::move(done.error())};
  }
  sensor->fd_ = UniqueFd{::open(node.path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)};
  if (!sensor->fd_) {
    return fail_errno(node.path.string());
  }
  sensor->enabler_ = std::jthread{[enable = node.sysfs / "buffer/enable"] {
    if (const auto enabled = write_file(enable, "1"); !enabled) {
      log::warning("iio", "{}", enabled.error().message);
    }
  }};
  return sensor;
}

IioSensor::~IioSensor() {
  if (enabler_.joinable()) {
    enabler_.join();
  }
  (void)write_file(node_.sysfs / "buffer/enable", "0");  // a device that is gone is off
}

Result<std::vector<IioReading>> IioSensor::take() {
  std::vector<IioReading> readings;
  std::vector<std::byte> bytes(kReadScans * scan_bytes_);
  const auto size = ::read(fd_.get(), bytes.data(), bytes.size());
  if (size < 0) {
    // EAGAIN: nothing there; EBUSY: it is being turned on.
    if (errno == EAGAIN || errno == EBUSY || errno == EINTR) {
      return readings;
    }
    const int number = errno;
    return fail(number == ENODEV ? ErrorCode::kNotFound : ErrorCode::kSystem, "{}: {}",
                node_.path.string(), std::system_category().message(number));
  }
  auto left = std::span<const std::byte>{bytes}.first(static_cast<std::size_t>(size));
  for (; left.size() >= scan_bytes_; left = left.subspan(scan_bytes_)) {
    IioReading reading;
    for (std::size_t i = 0; i < reading.counts.size(); ++i) {
      reading.counts.at(i) = static_cast<std::int32_t>(read_element(axes_.at(i), left));
    }
    reading.t_ns = read_element(axes_.back(), left);
    readings.push_back(reading);
  }
  return readings;
}

}  // namespace geoflow::drivers::v4l2
