#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "v4l2/topology.hpp"

/// Sensors behind the kernel's IIO (Documentation/ABI/testing/sysfs-bus-iio).
namespace geoflow::drivers::v4l2 {

/// One element of a scan: where it lies and how it is stored.
struct ScanElement {
  int index = 0;  ///< place in the scan's order
  bool big_endian = false;
  bool is_signed = true;
  int real_bits = 0;
  int storage_bits = 0;
  int shift = 0;
  std::size_t offset = 0;  ///< in the scan [bytes]; by lay_out()
};

/// Reads a type like "le:s16/32>>0". kInvalidData of anything else. Pure.
[[nodiscard]] Result<ScanElement> parse_scan_type(std::string_view text);

/// Gives each element its offset (its own size's multiple, in order of index); the scan's size.
[[nodiscard]] std::size_t lay_out(std::span<ScanElement> elements);

/// The value of an element in a scan that holds it.
[[nodiscard]] std::int64_t read_element(const ScanElement& element,
                                        std::span<const std::byte> scan);

struct IioReading {
  std::array<std::int32_t, 3> counts{};
  std::int64_t t_ns = 0;  ///< of whatever clock the kernel took
};

/// One sensor of three axes, being read. Its thread only turns the sensor on, for which the kernel
/// takes up to two seconds; destruction waits for that. Otherwise thread-bound.
class IioSensor {
 public:
  /// Sets the sensor up and begins to turn it on; `rate_code` is what the firmware takes for a
  /// frequency. Errors name the file that could not be written.
  [[nodiscard]] static Result<std::unique_ptr<IioSensor>> start(const IioNode& node, int rate_code);
  IioSensor(const IioSensor&) = delete;
  IioSensor& operator=(const IioSensor&) = delete;
  ~IioSensor();

  [[nodiscard]] int fd() const noexcept { return fd_.get(); }
  /// The bits of an axis: 16 or 32.
  [[nodiscard]] int axis_bits() const noexcept { return axes_[0].real_bits; }
  /// All readings that are there; kNotFound: the device is gone.
  [[nodiscard]] Result<std::vector<IioReading>> take();

 private:
  IioSensor(const IioNode& node, UniqueFd fd) : node_{node}, fd_{std::move(fd)} {}

  IioNode node_;
  UniqueFd fd_;
  std::array<ScanElement, 4> axes_{};  ///< x, y, z, time
  std::size_t scan_bytes_ = 0;
  std::jthread enabler_;
};

}  // namespace geoflow::drivers::v4l2
