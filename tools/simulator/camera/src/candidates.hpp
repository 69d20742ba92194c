#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace geoflow::simulator {

/// What rays may meet: a few patches, people, nothing, or whatever there is.
class Candidates {
 public:
  static constexpr std::size_t kMost = 6;  ///< more patches are whatever there is

  [[nodiscard]] bool operator==(const Candidates&) const = default;

  constexpr void add_patch(std::uint32_t patch) noexcept {
    const auto known = patches();
    if (std::ranges::find(known, patch) != known.end()) {
      return;
    }
    if (count_ == kMost) {
      anything_ = true;
      return;
    }
    patches_[count_] = patch;
    ++count_;
  }
  constexpr void add_nothing() noexcept { nothing_ = true; }
  constexpr void add_people() noexcept { people_ = true; }
  constexpr void add_anything() noexcept { anything_ = true; }
  constexpr void add(const Candidates& others) noexcept {
    if (others.one_patch() && count_ > 0 && patches_[0] == others.patches_[0]) {
      return;  // as nearly always
    }
    nothing_ = nothing_ || others.nothing_;
    people_ = people_ || others.people_;
    anything_ = anything_ || others.anything_;
    for (const std::uint32_t patch : others.patches()) {
      add_patch(patch);
    }
  }

  [[nodiscard]] constexpr std::span<const std::uint32_t> patches() const noexcept {
    return std::span{patches_}.first(count_);
  }
  [[nodiscard]] constexpr bool nothing() const noexcept { return nothing_; }
  [[nodiscard]] constexpr bool people() const noexcept { return people_; }
  [[nodiscard]] constexpr bool anything() const noexcept { return anything_; }
  /// Is it one patch, and nothing else?
  [[nodiscard]] constexpr bool one_patch() const noexcept {
    return count_ == 1 && !nothing_ && !people_ && !anything_;
  }
  /// Can rays only miss?
  [[nodiscard]] constexpr bool none() const noexcept {
    return count_ == 0 && nothing_ && !people_ && !anything_;
  }

 private:
  std::array<std::uint32_t, kMost> patches_{};
  std::uint8_t count_ = 0;
  bool nothing_ = false;
  bool people_ = false;
  bool anything_ = false;
};

}  // namespace geoflow::simulator
