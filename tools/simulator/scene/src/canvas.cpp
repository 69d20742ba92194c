#include "src/canvas.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"

namespace geoflow::simulator {
namespace {

constexpr float kBlackest = 0.005F;  // soot
constexpr float kWhitest = 0.95F;    // fresh snow

int wrapped(int value, int period) {
  const int rest = value % period;
  return rest < 0 ? rest + period : rest;
}

float smooth(float t) {
  constexpr float kThree = 3.0F;
  return t * t * (kThree - 2.0F * t);
}

}  // namespace

FractalNoise::FractalNoise(const Canvas::Noise& noise, std::uint64_t key) {
  constexpr float kToUnitDeviation =
      2.6F;  // of uniform numbers interpolated smoothly in two directions
  float squares = 0;
  float weight = 1;
  int cells = noise.cells;
  for (int i = 0; i < noise.octaves; ++i) {
    Octave octave{.columns = cells * noise.stretch, .rows = cells, .nodes = {}};
    Random random{subkey(key, static_cast<std::uint64_t>(i))};
    octave.nodes.resize(static_cast<std::size_t>(octave.columns) *
                        static_cast<std::size_t>(octave.rows));
    for (float& node : octave.nodes) {
      node = kToUnitDeviation * weight * random.uniform(-1.0F, 1.0F);
    }
    octaves_.push_back(std::move(octave));
    squares += weight * weight;
    weight *= 0.5F;
    cells *= 2;
  }
  for (Octave& octave : octaves_) {
    for (float& node : octave.nodes) {
      node /= std::sqrt(squares);
    }
  }
}

float FractalNoise::Octave::at(float u, float v) const {
  const float x = u * static_cast<float>(columns);
  const float y = v * static_cast<float>(rows);
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const float fx = smooth(x - static_cast<float>(x0));
  const float fy = smooth(y - static_cast<float>(y0));
  const auto node = [&](int dx, int dy) {
    return nodes[static_cast<std::size_t>(wrapped(y0 + dy, rows)) *
                     static_cast<std::size_t>(columns) +
                 static_cast<std::size_t>(wrapped(x0 + dx, columns))];
  };
  const float top = node(0, 0) * (1.0F - fx) + node(1, 0) * fx;
  const float bottom = node(0, 1) * (1.0F - fx) + node(1, 1) * fx;
  return top * (1.0F - fy) + bottom * fy;
}

float FractalNoise::operator()(float u, float v) const {
  float sum = 0;
  for (const Octave& octave : octaves_) {
    sum += octave.at(u, v);
  }
  return sum;
}

Rgb& Canvas::at(int x, int y) noexcept {
  return pixels_[static_cast<std::size_t>(wrapped(y, side_)) * static_cast<std::size_t>(side_) +
                 static_cast<std::size_t>(wrapped(x, side_))];
}

void Canvas::rectangle(float x, float y, float width, float height, const Rgb& colour) {
  const auto pixel = [&](float fraction) {
    return static_cast<int>(std::lround(fraction * static_cast<float>(side_)));
  };
  for (int row = pixel(y); row < std::max(pixel(y) + 1, pixel(y + height)); ++row) {
    for (int column = pixel(x); column < std::max(pixel(x) + 1, pixel(x + width)); ++column) {
      at(column, row) = colour;
    }
  }
}

void Canvas::disc(float x, float y, float radius, const Rgb& colour) {
  const auto side = static_cast<float>(side_);
  const int reach = static_cast<int>(std::ceil(radius * side));
  const int cx = static_cast<int>(x * side);
  const int cy = static_cast<int>(y * side);
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      if (static_cast<float>(dx * dx + dy * dy) <= radius * radius * side * side) {
        at(cx + dx, cy + dy) = colour;
      }
    }
  }
}

void Canvas::modulate(const Noise& noise, std::uint64_t key) {
  const float pixel = 1.0F / static_cast<float>(side_);
  const FractalNoise field{noise, key};
  for (int y = 0; y < side_; ++y) {
    for (int x = 0; x < side_; ++x) {
      const float value = field(static_cast<float>(x) * pixel, static_cast<float>(y) * pixel);
      at(x, y) *= std::max(0.0F, 1.0F + noise.amplitude * value);
    }
  }
}

void Canvas::speckle(float amplitude, Random random) {
  for (Rgb& pixel : pixels_) {
    pixel *= std::max(0.0F, 1.0F + amplitude * random.normal());
  }
}

void Canvas::crack(float x, float y, const Rgb& colour, Random random) {
  constexpr int kPieces = 60;
  constexpr float kPiece = 0.008F;
  constexpr float kBend_rad = 0.5F;
  float direction = random.uniform(0.0F, 2.0F * std::numbers::pi_v<float>);
  const int pixels_a_piece = std::max(1, static_cast<int>(kPiece * static_cast<float>(side_)));
  const float step = kPiece / static_cast<float>(pixels_a_piece);
  for (int piece = 0; piece < kPieces; ++piece) {
    direction += kBend_rad * random.normal() * 0.5F;
    for (int i = 0; i < pixels_a_piece; ++i) {
      x += step * std::cos(direction);
      y += step * std::sin(direction);
      at(static_cast<int>(std::floor(x * static_cast<float>(side_))),
         static_cast<int>(std::floor(y * static_cast<float>(side_)))) = colour;
    }
  }
}

void Canvas::scale_contrast(float factor) {
  Rgb mean{};
  for (const Rgb& pixel : pixels_) {
    mean += pixel;
  }
  mean /= static_cast<float>(pixels_.size());
  for (Rgb& pixel : pixels_) {
    pixel = mean + factor * (pixel - mean);
    for (int c = 0; c < 3; ++c) {
      pixel[c] = std::clamp(pixel[c], kBlackest, kWhitest);
    }
  }
}

}  // namespace geoflow::simulator
