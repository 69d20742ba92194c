#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

namespace geoflow::timesync::tests {

/// A value that counts its alive_count instances, so that construction equals destruction can be
/// asserted.
class Counted {
 public:
  explicit Counted(std::uint64_t value = 0) : value_{value} { ++alive_count; }
  Counted(const Counted& other) : value_{other.value_} { ++alive_count; }
  Counted(Counted&& other) noexcept : value_{std::exchange(other.value_, 0)} { ++alive_count; }
  Counted& operator=(const Counted&) = default;
  Counted& operator=(Counted&& other) noexcept {
    value_ = std::exchange(other.value_, 0);
    return *this;
  }
  ~Counted() { --alive_count; }

  [[nodiscard]] std::uint64_t value() const noexcept { return value_; }
  [[nodiscard]] static std::int64_t alive() noexcept { return alive_count; }

 private:
  std::uint64_t value_;
  static inline std::atomic<std::int64_t> alive_count{0};
};

}  // namespace geoflow::timesync::tests
