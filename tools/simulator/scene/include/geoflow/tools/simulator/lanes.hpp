#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

/// Arithmetic on several rays at once: arrays of one number a ray, in loops that the compiler turns
/// into vector instructions.
namespace geoflow::simulator {

/// Linear red, green, blue and an unused fourth, for arithmetic on all at once.
using Rgb = float __attribute__((vector_size(16)));

inline constexpr std::size_t kLanes = 16;
using Lanes = std::array<float, kLanes>;
using LaneColours = std::array<Rgb, kLanes>;

/// `value` within low … high; not a number becomes low. Unlike std::clamp, it says what a lane of
/// which nothing is known becomes.
[[nodiscard]] constexpr float held(float value, float low, float high) noexcept {
  const float raised = value > low ? value : low;
  return raised < high ? raised : high;
}

/// The largest whole number not above a number that fits an int.
[[nodiscard]] constexpr int whole_below(float value) noexcept {
  const int truncated = static_cast<int>(value);
  return truncated - (value < static_cast<float>(truncated) ? 1 : 0);
}

/// Four neighbours in a grid and their shares, for each lane.
struct Taps {
  std::array<std::array<std::uint32_t, kLanes>, 4> index{};
  std::array<Lanes, 4> share{};

  /// The shares of the neighbours of a point `fx`, `fy` of a cell beyond the first one.
  constexpr void weigh(std::size_t lane, float fx, float fy) noexcept {
    share[0][lane] = (1.0F - fx) * (1.0F - fy);
    share[1][lane] = fx * (1.0F - fy);
    share[2][lane] = (1.0F - fx) * fy;
    share[3][lane] = fx * fy;
  }
  /// The mean of `node(index)` over a lane's neighbours.
  template <typename Node>
  [[nodiscard]] constexpr Rgb mix(std::size_t lane, const Node& node) const noexcept {
    return node(index[0][lane]) * share[0][lane] + node(index[1][lane]) * share[1][lane] +
           node(index[2][lane]) * share[2][lane] + node(index[3][lane]) * share[3][lane];
  }
};

#ifdef __x86_64__
namespace detail {
template <typename Body>
[[gnu::target("avx2,fma"), gnu::noinline]] void run_with_avx2(const Body& body) {
  body();
}
template <typename Body>
[[gnu::target("avx2,fma,avx512f,avx512bw,avx512dq,avx512vl"), gnu::noinline]] void run_with_avx512(
    const Body& body) {
  body();
}
enum class Vectors : std::uint8_t { kFour, kEight, kSixteen };
/// The widest that the machine has.
inline Vectors widest_vectors() noexcept {
  const bool eight = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  const bool sixteen =
      eight && __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
      __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0;
  return sixteen ? Vectors::kSixteen : (eight ? Vectors::kEight : Vectors::kFour);
}
}  // namespace detail
#endif

/// Runs `body()` compiled for AVX-512 or AVX2 where the machine has it, so that one program uses
/// sixteen or eight lanes where it can. What `body` calls must be inlined into it, and it must
/// itself be declared `__attribute__((always_inline))`. Results may differ in the last bit between
/// machines with and without either (fused multiplication), not between runs on one.
template <typename Body>
void with_wide_vectors(const Body& body) {
#ifdef __x86_64__
  static const detail::Vectors vectors = detail::widest_vectors();
  if (vectors == detail::Vectors::kSixteen) {
    detail::run_with_avx512(body);
    return;
  }
  if (vectors == detail::Vectors::kEight) {
    detail::run_with_avx2(body);
    return;
  }
#endif
  body();
}

}  // namespace geoflow::simulator
