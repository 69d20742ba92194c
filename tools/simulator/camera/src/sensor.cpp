#include "src/sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include <tbb/parallel_for.h>

#include "geoflow/hal/image.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/texture.hpp"

namespace geoflow::simulator {
namespace {

// A D435i's colour: OV2740, 1.4 um pixels, 1440 x 1080 of which give 640 x 480: 2.25^2 = 5 a pixel;
// lens f/2.
constexpr double kFNumber = 2.0;
constexpr double kTransmission = 0.9;
// Electrons of one output pixel and channel for a lux second on the sensor: 4090 photons/(um^2 lx
// s) at 555 nm, about three times that of white light in the visible band, quantum efficiency 0.5,
// colour filter 0.33, 1.96 um^2, 5 pixels.
constexpr double kElectronsPerLuxSecond = 20'000;
constexpr double kFullWell = 20'000;  // 5 pixels of 4000 electrons
constexpr double kReadNoise = 5.6;    // sqrt(5) pixels of 2.5 electrons
constexpr double kMiddleGrey = 0.16;  // of full well; 112 of 255 after sRGB's curve

/// sRGB's curve (IEC 61966-2-1) over 0 … 1 as a table.
class Curve {
 public:
  Curve() {
    for (std::size_t i = 0; i < kSteps; ++i) {
      // NOLINTBEGIN(readability-magic-numbers): IEC 61966-2-1
      const double linear = static_cast<double>(i) / static_cast<double>(kSteps - 1);
      const double encoded =
          linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
      codes_[i] = static_cast<std::uint8_t>(std::lround(255.0 * encoded));
      // NOLINTEND(readability-magic-numbers)
    }
  }
  /// Which step of the curve a value is at.
  [[nodiscard, gnu::always_inline]] static int step(float linear) noexcept {
    return static_cast<int>(held(linear, 0.0F, 1.0F) * static_cast<float>(kSteps - 1) + 0.5F);
  }
  [[nodiscard]] std::byte code(int step) const noexcept {
    return std::byte{codes_[static_cast<std::size_t>(step)]};
  }

 private:
  static constexpr std::size_t kSteps = 8192;
  std::array<std::uint8_t, kSteps> codes_{};
};

double electrons_per_nit(double exposure_s) {
  // Illuminance behind a lens: pi / 4 * L * transmission / N^2.
  constexpr double kQuarterTurn = 0.25 * std::numbers::pi;
  return kQuarterTurn * kTransmission / (kFNumber * kFNumber) * kElectronsPerLuxSecond * exposure_s;
}

/// One number for each of red, green and blue of kLanes pixels.
template <typename Number>
using Channels = std::array<std::array<Number, kLanes>, 3>;

/// Signals [electrons] to shares of the range, with noise.
struct Pixel {
  float electrons_per_nit;
  float inverse_full_well;  ///< with gain
  float noise_scale;

  /// `bits`: of the first pixel; the others' follow.
  [[nodiscard, gnu::always_inline]] inline Channels<float> read(const LaneColours& light,
                                                                std::uint32_t bits) const noexcept {
    constexpr auto kReadVariance = static_cast<float>(kReadNoise * kReadNoise);
    const float per_nit = electrons_per_nit;
    const float scale = noise_scale;
    const float inverse_range = inverse_full_well;
    Channels<float> values;
    for (std::size_t c = 0; c < values.size(); ++c) {
      for (std::size_t i = 0; i < kLanes; ++i) {
        const float signal = light[i][static_cast<int>(c)] * per_nit;
        const std::uint32_t own = scramble32(bits + static_cast<std::uint32_t>(i));
        const float noise =
            std::sqrt(held(signal, 0.0F, kMost) + kReadVariance) *
            to_normal32(scramble32(own + static_cast<std::uint32_t>(c) * kChannelStep));
        values[c][i] = (signal + scale * noise) * inverse_range;
      }
    }
    return values;
  }

 private:
  static constexpr std::uint32_t kChannelStep = 0x9e3779b9U;  // 2^32 over the golden ratio
  static constexpr float kMost = std::numeric_limits<float>::max();
};

/// Steps of the curve for pixels that are grey (the first channel's), or of three colours.
[[gnu::always_inline]] inline Channels<int> encode(const Channels<float>& values, bool grey) {
  Channels<int> steps{};
  for (std::size_t c = 0; c < values.size(); ++c) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      steps[c][i] = Curve::step(values[c][i]);
    }
  }
  for (std::size_t i = 0; grey && i < kLanes; ++i) {
    steps[0][i] = Curve::step(luminance(Rgb{values[0][i], values[1][i], values[2][i], 0}));
  }
  return steps;
}

/// Writes `count` pixels that are grey, or blue, green and red.
void write(const Curve& curve, const Channels<int>& steps, bool grey, std::size_t count,
           std::span<std::byte> image) {
  for (std::size_t i = 0; i < count; ++i) {
    if (grey) {
      image[i] = curve.code(steps[0][i]);
      continue;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      image[3 * i + c] = curve.code(steps[2 - c][i]);
    }
  }
}

}  // namespace

Exposure choose_exposure(double luminance_nit, const CameraOptions& options) {
  constexpr double kDarkest_nit = 1e-6;
  const double wanted = options.exposure_compensation * kMiddleGrey * kFullWell;
  const double exposure_s = wanted / electrons_per_nit(1.0) / std::max(luminance_nit, kDarkest_nit);
  const double open_s = std::clamp(exposure_s, options.exposure_min_s, options.exposure_max_s);
  return {.exposure_s = open_s, .gain = std::clamp(exposure_s / open_s, 1.0, options.gain_max)};
}

FrameRef develop(const std::vector<Rgb>& luminance_nit, const Exposure& exposure,
                 const CameraOptions& options, std::uint64_t key) {
  static const Curve curve;
  FrameRef frame = FramePool{1}.acquire(
      {.width = options.width, .height = options.height, .format = options.color_format});
  const std::span<std::byte> bytes = frame.writable_bytes();
  const bool grey = options.color_format == PixelFormat::kGray8;
  const Pixel pixel{.electrons_per_nit = static_cast<float>(electrons_per_nit(exposure.exposure_s)),
                    .inverse_full_well = static_cast<float>(exposure.gain / kFullWell),
                    .noise_scale = static_cast<float>(options.noise_scale)};
  const auto width = static_cast<std::size_t>(options.width);
  const std::size_t bytes_a_pixel = grey ? 1 : 3;
  tbb::parallel_for(std::size_t{0}, static_cast<std::size_t>(options.height), [&](std::size_t row) {
    const auto row_key = static_cast<std::uint32_t>(subkey(key, row));
    const std::size_t end = (row + 1) * width;
    for (std::size_t i = row * width; i < end; i += kLanes) {
      const std::size_t count = std::min(kLanes, end - i);
      LaneColours light{};
      std::copy_n(luminance_nit.begin() + static_cast<std::ptrdiff_t>(i), count, light.begin());
      Channels<int> steps;
      with_wide_vectors([&]() __attribute__((always_inline)) {
        steps = encode(pixel.read(light, row_key + static_cast<std::uint32_t>(i)), grey);
      });
      write(curve, steps, grey, count, bytes.subspan(bytes_a_pixel * i));
    }
  });
  return frame;
}

}  // namespace geoflow::simulator
