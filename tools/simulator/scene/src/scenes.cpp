#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geoflow/hal/nearest_name.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/builder.hpp"
#include "src/canvas.hpp"
#include "src/layouts.hpp"

namespace geoflow::simulator {
namespace {

using LayOut = void (*)(Builder, Random);

template <bool Structure, bool Textured, bool Near>
void lay_out_case(Builder builder, Random random) {
  lay_out_structure(std::move(builder), {.structure = Structure, .texture = Textured, .near = Near},
                    random);
}

constexpr std::array kScenes{
    SceneInfo{
        .name = "office",
        .summary =
            "desks, shelves and carpet; a figure of eight round two blocks of desks (the paper's "
            "Seq1)"},
    SceneInfo{.name = "corridor", .summary = "white walls, few doors, people walking by (Seq2)"},
    SceneInfo{.name = "parking", .summary = "underground, dark, a floor that mirrors, cars (Seq3)"},
    SceneInfo{
        .name = "plaza",
        .summary = "sunny paving that repeats, most of all else beyond the reach of depth (Seq4)"},
    SceneInfo{
        .name = "home",
        .summary = "living room, kitchen and hall; a round through three doors, for closing loops"},
    SceneInfo{.name = "str_tex_far",
              .summary = "folded coloured panels, 2 m away (TUM fr3 structure_texture_far)"},
    SceneInfo{.name = "str_tex_near", .summary = "folded coloured panels, 1 m away"},
    SceneInfo{.name = "str_notex_far", .summary = "folded plain panels, 2 m away"},
    SceneInfo{.name = "str_notex_near", .summary = "folded plain panels, 1 m away"},
    SceneInfo{.name = "nostr_tex_far", .summary = "a flat coloured wall, 2 m away"},
    SceneInfo{.name = "nostr_tex_near", .summary = "a flat coloured wall, 1 m away"},
    SceneInfo{.name = "nostr_notex_far", .summary = "a flat plain wall, 2 m away"},
    SceneInfo{.name = "nostr_notex_near", .summary = "a flat plain wall, 1 m away"},
};
constexpr std::array<LayOut, kScenes.size()> kLayouts{
    lay_out_office,
    lay_out_corridor,
    lay_out_parking,
    lay_out_plaza,
    lay_out_home,
    lay_out_case<true, true, false>,
    lay_out_case<true, true, true>,
    lay_out_case<true, false, false>,
    lay_out_case<true, false, true>,
    lay_out_case<false, true, false>,
    lay_out_case<false, true, true>,
    lay_out_case<false, false, false>,
    lay_out_case<false, false, true>,
};

// NOLINTBEGIN(readability-magic-numbers): the last two of each row are its range
constexpr std::array<Knob<SceneOptions>, 4> kKnobs{{
    {.name = "scene.light_level",
     .unit = "1",
     .summary = "times the scene's lights",
     .member = &SceneOptions::light_level,
     .minimum = 0.001,
     .maximum = 100},
    {.name = "scene.texture_contrast",
     .unit = "1",
     .summary = "times the textures' deviation from their mean",
     .member = &SceneOptions::texture_contrast,
     .minimum = 0,
     .maximum = 3},
    {.name = "scene.reflectivity",
     .unit = "1",
     .summary = "times the mirror reflectance of floors, glass and cars",
     .member = &SceneOptions::reflectivity,
     .minimum = 0,
     .maximum = 10},
    {.name = "scene.pedestrians",
     .unit = "",
     .summary = "how many walk about; -1: as many as the scene has by itself",
     .member = &SceneOptions::pedestrians,
     .minimum = -1,
     .maximum = 20},
}};
// NOLINTEND(readability-magic-numbers)

}  // namespace

std::span<const Knob<SceneOptions>> scene_knobs() {
  return kKnobs;
}

std::span<const SceneInfo> scenes() {
  return kScenes;
}

Result<Scene> make_scene(std::string_view name, std::uint64_t seed, const SceneOptions& options) {
  const auto* const found = std::ranges::find(kScenes, name, &SceneInfo::name);
  if (found == kScenes.end()) {
    std::array<std::string_view, kScenes.size()> names;
    std::ranges::transform(kScenes, names.begin(), &SceneInfo::name);
    return fail(ErrorCode::kInvalidArgument, "\"{}\" is no scene; the nearest is {}", name,
                nearest_name(names, name));
  }
  Scene scene;
  scene.name = name;
  scene.seed = seed;
  kLayouts[static_cast<std::size_t>(std::distance(kScenes.begin(), found))](Builder{scene, options},
                                                                            Random{seed, name});
  return scene;
}

void add_pedestrians(Builder builder, const std::vector<std::vector<Vector2f>>& lines, int fallback,
                     Random random) {
  const SceneOptions& options = builder.options();
  const int count = options.pedestrians < 0 ? fallback : options.pedestrians;
  for (int i = 0; i < count; ++i) {
    // NOLINTBEGIN(readability-magic-numbers): clothes and skin, free walking speeds and statures of
    // adults
    const float tone = random.uniform(0.12F, 0.55F);
    const int skin = builder.paint(Rgb{tone, 0.72F * tone, 0.58F * tone, 0});
    const int top = builder.paint(Rgb{random.uniform(0.03F, 0.6F), random.uniform(0.03F, 0.6F),
                                      random.uniform(0.03F, 0.6F), 0});
    const int trousers = builder.paint(Rgb{random.uniform(0.02F, 0.2F), random.uniform(0.02F, 0.2F),
                                           random.uniform(0.03F, 0.25F), 0});
    const int shoes = builder.paint(grey(random.uniform(0.02F, 0.5F)));
    builder.scene().pedestrians.emplace_back(
        Pedestrian::Walk{.waypoints = lines[static_cast<std::size_t>(i) % lines.size()],
                         .speed_mps = random.uniform(0.9F, 1.5F),
                         .start_m = random.uniform(0.0F, 60.0F),
                         .height_m = random.uniform(1.55F, 1.9F),
                         .materials = {skin, top, trousers, shoes}});
    // NOLINTEND(readability-magic-numbers)
  }
}

}  // namespace geoflow::simulator
