#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

namespace geoflow::timesync::tests {

/// A value that counts its living instances, so that construction equals destruction can be
/// asserted.
class Counted {
 public:
  explicit Counted(std::uint64_t value = 0) : value_{value} { ++alive_; }
  Counted(const Counted& other) : value_{other.value_} { ++alive_; }
  Counted(Counted&& other) noexcept : value_{std::exchange(other.value_, 0)} { ++alive_; }
  Counted& operator=(const Counted&) = default;
  Counted& operator=(Counted&& other) noexcept {
    value_ = std::exchange(other.value_, 0);
    return *this;
  }
  ~Counted() { --alive_; }

  [[nodiscard]] std::uint64_t value() const noexcept { return value_; }
  [[nodiscard]] static std::int64_t alive() noexcept { return alive_; }

 private:
  std::uint64_t value_;
  static inline std::atomic<std::int64_t> alive_{0};
};

}  // namespace geoflow::timesync::tests
