#include "src/sensor.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
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
  [[nodiscard]] std::uint8_t operator()(float linear) const noexcept {
    const float from_edge = std::clamp(linear, 0.0F, 1.0F) * static_cast<float>(kSteps - 1) + 0.5F;
    return codes_[static_cast<std::size_t>(from_edge)];
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

/// Signals [electrons] to shares of the range, with noise.
struct Pixel {
  float electrons_per_nit;
  float inverse_full_well;  ///< with gain
  float noise_scale;

  /// `bits`: of this pixel.
  [[nodiscard, gnu::always_inline]] Rgb read(const Rgb& light, std::uint32_t bits) const noexcept {
    constexpr auto kReadVariance = static_cast<float>(kReadNoise * kReadNoise);
    const Rgb signal = light * electrons_per_nit;
    std::array<float, 4> noise{};
    for (std::size_t c = 0; c < noise.size(); ++c) {
      const float variance = std::max(signal[static_cast<int>(c)], 0.0F) + kReadVariance;
      noise[c] = std::sqrt(variance) *
                 to_normal32(scramble32(bits + static_cast<std::uint32_t>(c) * kChannelStep));
    }
    return (signal + noise_scale * std::bit_cast<Rgb>(noise)) * inverse_full_well;
  }

 private:
  static constexpr std::uint32_t kChannelStep = 0x9e3779b9U;  // 2^32 over the golden ratio
};

/// Writes pixel i of an image that is grey, or blue, green and red.
[[gnu::always_inline]] inline void write(const Curve& curve, const Rgb& value, bool grey,
                                         std::size_t i, std::span<std::byte> image) {
  if (grey) {
    image[i] = static_cast<std::byte>(curve(luminance(value)));
    return;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    image[3 * i + c] = static_cast<std::byte>(curve(value[2 - c]));
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
  tbb::parallel_for(std::size_t{0}, static_cast<std::size_t>(options.height), [&](std::size_t row) {
    with_wide_vectors([&]() __attribute__((always_inline)) {
      const auto row_key = static_cast<std::uint32_t>(subkey(key, row));
      for (std::size_t i = row * width; i < (row + 1) * width; ++i) {
        const Rgb value =
            pixel.read(luminance_nit[i], scramble32(row_key + static_cast<std::uint32_t>(i)));
        write(curve, value, grey, i, bytes);
      }
    });
  });
  return frame;
}

}  // namespace geoflow::simulator
