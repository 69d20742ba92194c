#include "src/painters.hpp"

#include <algorithm>

#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"

#include "src/canvas.hpp"

// A picture is its colours and proportions. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::simulator {
namespace {

constexpr int kFine = 512;
constexpr int kMedium = 256;

Rgb random_colour(Random& random, float darkest, float brightest) {
  const float value = random.uniform(darkest, brightest);
  return Rgb{value * random.uniform(0.3F, 1.0F), value * random.uniform(0.3F, 1.0F),
             value * random.uniform(0.3F, 1.0F), 0};
}

/// Multiplies `size` pixels from `corner` on.
void brighten(Canvas& canvas, const Eigen::Vector2i& corner, const Eigen::Vector2i& size,
              float brightness) {
  for (int y = 0; y < size.y(); ++y) {
    for (int x = 0; x < size.x(); ++x) {
      canvas.at(corner.x() + x, corner.y() + y) *= brightness;
    }
  }
}

/// A paragraph: rows of dark words.
void write_text(Canvas& canvas, float x, float y, float width, float height, Random random) {
  constexpr float kLine = 0.022F;
  const Rgb ink = grey(random.uniform(0.03F, 0.15F));
  for (float row = 0; row + kLine < height; row += 2.0F * kLine) {
    for (float at = 0; at < width;) {
      const float word = random.uniform(0.02F, 0.09F);
      canvas.rectangle(x + at, y + row, std::min(word, width - at), kLine, ink);
      at += word + 0.015F;
    }
  }
}

}  // namespace

Canvas paint_carpet(const Rgb& colour, Random random) {
  Canvas canvas{kFine, colour};
  canvas.modulate({.cells = 3, .octaves = 3, .amplitude = 0.07F}, random.bits());
  canvas.modulate({.cells = 48, .octaves = 3, .amplitude = 0.16F}, random.bits());
  canvas.speckle(0.25F, random.fork("pile"));
  for (int i = 0; i < 260; ++i) {
    canvas.disc(random.uniform(), random.uniform(), random.uniform(0.001F, 0.004F),
                colour * random.uniform(0.4F, 2.2F));
  }
  return canvas;
}

Canvas paint_concrete(float reflectance, Random random) {
  Canvas canvas{kFine, Rgb{reflectance, reflectance * 0.98F, reflectance * 0.93F, 0}};
  canvas.modulate({.cells = 3, .octaves = 6, .amplitude = 0.10F}, random.bits());
  canvas.speckle(0.05F, random.fork("grain"));
  for (int i = 0; i < 160; ++i) {
    canvas.disc(random.uniform(), random.uniform(), random.uniform(0.0008F, 0.003F),
                grey(reflectance * random.uniform(0.5F, 1.35F)));
  }
  for (int i = 0; i < 2; ++i) {
    canvas.crack(random.uniform(), random.uniform(), grey(0.5F * reflectance),
                 random.fork(i == 0 ? "first" : "second"));
  }
  return canvas;
}

Canvas paint_wood(const Rgb& colour, Random random) {
  Canvas canvas{kMedium, colour};
  canvas.modulate({.cells = 2, .octaves = 5, .amplitude = 0.16F, .stretch = 12}, random.bits());
  canvas.speckle(0.03F, random);
  return canvas;
}

Canvas paint_planks(const Rgb& colour, int planks, Random random) {
  Canvas canvas{kFine, colour};
  canvas.modulate({.cells = 2, .octaves = 5, .amplitude = 0.13F, .stretch = 12}, random.bits());
  const float width = 1.0F / static_cast<float>(planks);
  for (int plank = 0; plank < planks; ++plank) {
    const float cut = random.uniform();
    const float left = static_cast<float>(plank) * width;
    for (const float piece : {cut, cut + 0.5F}) {
      const float brightness = random.uniform(0.78F, 1.22F);
      brighten(canvas, {static_cast<int>(left * kFine), static_cast<int>(piece * kFine)},
               {kFine / planks, kFine / 2}, brightness);
      canvas.rectangle(left, piece, width, 0.003F, 0.35F * colour);
    }
    canvas.rectangle(left, 0, 0.003F, 1, 0.35F * colour);
  }
  canvas.speckle(0.03F, random);
  return canvas;
}

Canvas paint_plaster(const Rgb& colour, Random random) {
  Canvas canvas{kMedium, colour};
  canvas.modulate({.cells = 3, .octaves = 3, .amplitude = 0.006F}, random.bits());
  canvas.modulate({.cells = 64, .octaves = 2, .amplitude = 0.008F}, random.bits());
  return canvas;
}

Canvas paint_tiles(const TileStyle& style, Random random) {
  Canvas canvas{kFine, style.colour};
  // One stone's grain for all tiles: that is what makes them repeat.
  const FractalNoise grain{{.cells = 8, .octaves = 5}, random.bits()};
  const float tile = 1.0F / static_cast<float>(style.count);
  for (int y = 0; y < kFine; ++y) {
    for (int x = 0; x < kFine; ++x) {
      const float u = static_cast<float>(x % (kFine / style.count)) / static_cast<float>(kFine) *
                      static_cast<float>(style.count);
      const float v = static_cast<float>(y % (kFine / style.count)) / static_cast<float>(kFine) *
                      static_cast<float>(style.count);
      canvas.at(x, y) *= std::max(0.1F, 1.0F + 0.06F * grain(u, v));
    }
  }
  const float joint = tile * style.joint_fraction;
  for (int row = 0; row < style.count; ++row) {
    for (int column = 0; column < style.count; ++column) {
      const float brightness = 1.0F + style.variation * random.normal();
      const int side = kFine / style.count;
      brighten(canvas, {column * side, row * side}, {side, side}, brightness);
      canvas.rectangle(static_cast<float>(column) * tile, static_cast<float>(row) * tile, tile,
                       joint, style.joint);
      canvas.rectangle(static_cast<float>(column) * tile, static_cast<float>(row) * tile, joint,
                       tile, style.joint);
    }
  }
  return canvas;
}

Canvas paint_bricks(const Rgb& colour, Random random) {
  constexpr int kCourses = 8;
  constexpr int kBricks = 4;
  Canvas canvas{kFine, grey(0.45F)};
  for (int course = 0; course < kCourses; ++course) {
    for (int brick = 0; brick < kBricks; ++brick) {
      const float shift = (course % 2 == 0) ? 0.0F : 0.5F;
      canvas.rectangle((static_cast<float>(brick) + shift) / kBricks + 0.006F,
                       static_cast<float>(course) / kCourses + 0.006F, 1.0F / kBricks - 0.012F,
                       1.0F / kCourses - 0.012F, colour * random.uniform(0.7F, 1.25F));
    }
  }
  canvas.modulate({.cells = 16, .octaves = 4, .amplitude = 0.10F}, random.bits());
  return canvas;
}

Canvas paint_poster(Random random) {
  Canvas canvas{kMedium, random.chance(0.6F) ? grey(random.uniform(0.6F, 0.85F))
                                             : random_colour(random, 0.2F, 0.8F)};
  const int blocks = 3 + random.index(5);
  for (int i = 0; i < blocks; ++i) {
    const float width = random.uniform(0.1F, 0.5F);
    const float height = random.uniform(0.08F, 0.35F);
    const float x = random.uniform(0.03F, 0.97F - width);
    const float y = random.uniform(0.03F, 0.97F - height);
    const Rgb colour = random_colour(random, 0.05F, 0.85F);
    if (random.chance(0.3F)) {
      canvas.disc(x + 0.5F * width, y + 0.5F * height, 0.4F * std::min(width, height), colour);
    } else if (random.chance(0.5F)) {
      canvas.rectangle(x, y, width, height, colour);
    } else {
      write_text(canvas, x, y, width, height, random.fork("text"));
    }
  }
  write_text(canvas, 0.08F, 0.05F, 0.84F, 0.09F, random.fork("title"));
  return canvas;
}

Canvas paint_books(Random random) {
  constexpr int kBoards = 4;
  Canvas canvas{kMedium, grey(0.05F)};
  for (int board = 0; board < kBoards; ++board) {
    const float bottom = (static_cast<float>(board) + 0.94F) / kBoards;
    canvas.rectangle(0, bottom, 1, 0.06F / kBoards, Rgb{0.35F, 0.26F, 0.17F, 0});
    for (float x = 0; x < 0.98F;) {
      const float width = random.uniform(0.015F, 0.05F);
      const float height = random.uniform(0.55F, 0.86F) / kBoards;
      const Rgb colour = random_colour(random, 0.06F, 0.7F);
      if (!random.chance(0.06F)) {
        canvas.rectangle(x, bottom - height, width - 0.004F, height, colour);
        canvas.rectangle(x, bottom - height * random.uniform(0.5F, 0.9F), width - 0.004F, 0.02F,
                         random_colour(random, 0.3F, 0.9F));
      }
      x += width;
    }
  }
  return canvas;
}

Canvas paint_screen(Random random) {
  Canvas canvas{kMedium, random_colour(random, 0.1F, 0.5F)};
  for (int i = 0; i < 3; ++i) {
    const float x = random.uniform(0.02F, 0.5F);
    const float y = random.uniform(0.02F, 0.5F);
    canvas.rectangle(x, y, 0.45F, 0.42F, grey(random.chance(0.5F) ? 0.85F : 0.06F));
    canvas.rectangle(x, y, 0.45F, 0.03F, random_colour(random, 0.2F, 0.6F));
    write_text(canvas, x + 0.02F, y + 0.05F, 0.38F, 0.34F, random.fork("window"));
  }
  return canvas;
}

Canvas paint_facade(const Rgb& wall, Random random) {
  constexpr int kFloors = 2;
  constexpr int kColumns = 3;
  Canvas canvas{kFine, wall};
  canvas.modulate({.cells = 8, .octaves = 5, .amplitude = 0.05F}, random.bits());
  const float width = 0.62F / kColumns;
  const float height = 0.5F / kFloors;
  for (int floor = 0; floor < kFloors; ++floor) {
    for (int column = 0; column < kColumns; ++column) {
      const float x = (static_cast<float>(column) + 0.19F) / kColumns;
      const float y = (static_cast<float>(floor) + 0.25F) / kFloors;
      canvas.rectangle(x - 0.01F, y - 0.01F, width + 0.02F, height + 0.02F, 0.6F * wall);
      canvas.rectangle(x, y, width, height, random_colour(random, 0.05F, 0.3F));
      canvas.rectangle(x + 0.48F * width, y, 0.04F * width, height, grey(0.6F));
      if (random.chance(0.5F)) {
        canvas.rectangle(x, y, width, height * random.uniform(0.2F, 0.7F),
                         grey(random.uniform(0.4F, 0.7F)));
      }
    }
  }
  return canvas;
}

Canvas paint_foliage(Random random) {
  Canvas canvas{kMedium, Rgb{0.05F, 0.10F, 0.03F, 0}};
  for (int i = 0; i < 2500; ++i) {
    const float value = random.uniform(0.4F, 1.6F);
    canvas.disc(random.uniform(), random.uniform(), random.uniform(0.004F, 0.014F),
                Rgb{0.07F * value, 0.15F * value, 0.04F * value, 0});
  }
  return canvas;
}

Canvas paint_ceiling(Random random) {
  Canvas canvas{kMedium, grey(0.75F)};
  canvas.speckle(0.06F, random.fork("pores"));
  for (const float line : {0.0F, 0.5F}) {
    canvas.rectangle(line, 0, 0.015F, 1, grey(0.6F));
    canvas.rectangle(0, line, 1, 0.015F, grey(0.6F));
  }
  return canvas;
}

Canvas paint_pattern(const Rgb& ground, Random random) {
  Canvas canvas{kMedium, ground};
  for (int i = 0; i < 90; ++i) {
    const Rgb colour = random_colour(random, 0.05F, 0.8F);
    if (random.chance(0.5F)) {
      canvas.disc(random.uniform(), random.uniform(), random.uniform(0.01F, 0.06F), colour);
    } else {
      canvas.rectangle(random.uniform(), random.uniform(), random.uniform(0.02F, 0.12F),
                       random.uniform(0.02F, 0.12F), colour);
    }
  }
  canvas.speckle(0.06F, random.fork("weave"));
  return canvas;
}

Canvas paint_stains(float amplitude, Random random) {
  Canvas canvas{kFine, grey(0.5F)};
  canvas.modulate({.cells = 4, .octaves = 7, .amplitude = amplitude}, random.bits());
  for (int i = 0; i < 30; ++i) {
    canvas.disc(random.uniform(), random.uniform(), random.uniform(0.002F, 0.012F),
                grey(0.5F * (1.0F + 2.0F * amplitude * random.normal())));
  }
  for (int i = 0; i < 3; ++i) {
    canvas.crack(random.uniform(), random.uniform(), grey(0.5F - 1.5F * amplitude),
                 Random{random.bits()});
  }
  return canvas;
}

}  // namespace geoflow::simulator
// NOLINTEND(readability-magic-numbers)
