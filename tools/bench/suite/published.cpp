#include "bench/suite/published.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

namespace geoflow::tools {
namespace {

// The paper's figures themselves.
// NOLINTBEGIN(readability-magic-numbers)
constexpr auto kSequences = std::to_array<PublishedSequence>({
    // Table I
    {.suite = "go2", .ending = "seq1", .ate_m = 0.0947},
    {.suite = "go2", .ending = "seq2", .ate_m = 0.1369},
    {.suite = "go2", .ending = "seq3", .ate_m = 0.6009},
    {.suite = "go2", .ending = "seq4", .ate_m = 0.4458},
    // Table II
    {.suite = "openloris", .ending = "home1-1", .ate_m = 0.4575},
    {.suite = "openloris", .ending = "home1-2", .ate_m = 0.3775},
    {.suite = "openloris", .ending = "office1-1", .ate_m = 0.0577},
    {.suite = "openloris", .ending = "office1-2", .ate_m = 0.0700},
    {.suite = "openloris", .ending = "office1-3", .ate_m = 0.0291},
    {.suite = "openloris", .ending = "office1-4", .ate_m = 0.1554},
    {.suite = "openloris", .ending = "office1-5", .ate_m = 0.2000},
    // Tables III and IV
    {.suite = "tum", .ending = "freiburg1_xyz", .ate_m = 0.0101},
    {.suite = "tum", .ending = "freiburg1_desk", .ate_m = 0.0162},
    {.suite = "tum", .ending = "freiburg3_cabinet", .ate_m = 0.0500},
    {.suite = "tum", .ending = "freiburg3_large_cabinet", .ate_m = 0.0601},
    {.suite = "tum", .ending = "freiburg3_long_office_household", .in_table_iii = true},
    {.suite = "tum", .ending = "freiburg3_nostructure_texture_far", .in_table_iii = true},
    {.suite = "tum", .ending = "freiburg3_nostructure_texture_near_withloop", .in_table_iii = true},
    {.suite = "tum",
     .ending = "freiburg3_structure_notexture_far",
     .ate_m = 0.0116,
     .in_table_iii = true},
    {.suite = "tum",
     .ending = "freiburg3_structure_notexture_near",
     .ate_m = 0.0126,
     .in_table_iii = true},
    {.suite = "tum",
     .ending = "freiburg3_structure_texture_far",
     .ate_m = 0.0089,
     .in_table_iii = true},
    {.suite = "tum",
     .ending = "freiburg3_structure_texture_near",
     .ate_m = 0.0094,
     .in_table_iii = true},
    // Section V-C
    {.suite = "tum", .ending = "freiburg3_nostructure_notexture_far", .ate_m = 0.0308},
    // Table III
    {.suite = "scannet", .ending = "scene0050_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0059_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0084_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0106_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0169_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0181_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0207_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0580_00", .in_table_iii = true},
    {.suite = "scannet", .ending = "scene0616_00", .in_table_iii = true},
});

constexpr auto kMeans = std::to_array<PublishedMean>({
    {.suite = "scannet", .row = "r+o", .ate_m = 0.2404, .rte_m = 0.0095},
    {.suite = "scannet", .row = "r+i", .ate_m = 0.1055, .rte_m = 0.0100},
    {.suite = "scannet", .row = "r+d", .ate_m = 0.0775, .rte_m = 0.0094},
    {.suite = "scannet", .row = "r+o+i+d", .ate_m = 0.0779, .rte_m = 0.0090},
    {.suite = "tum", .row = "r+o", .ate_m = 0.0142, .rte_m = 0.0089},
    {.suite = "tum", .row = "r+i", .ate_m = 0.0156, .rte_m = 0.0106},
    {.suite = "tum", .row = "r+d", .ate_m = 0.0155, .rte_m = 0.0100},
    {.suite = "tum", .row = "r+o+i+d", .ate_m = 0.0129, .rte_m = 0.0086},
});
// NOLINTEND(readability-magic-numbers)

}  // namespace

const PublishedSequence* find_published(std::string_view suite, std::string_view name) noexcept {
  const auto* const found = std::ranges::find_if(kSequences, [&](const PublishedSequence& one) {
    return one.suite == suite && name.ends_with(one.ending);
  });
  return found == kSequences.end() ? nullptr : found;
}

const PublishedMean* find_published_mean(std::string_view suite, std::string_view row) noexcept {
  const auto* const found = std::ranges::find_if(
      kMeans, [&](const PublishedMean& one) { return one.suite == suite && one.row == row; });
  return found == kMeans.end() ? nullptr : found;
}

std::size_t table_iii_size(std::string_view suite) noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(
      kSequences,
      [&](const PublishedSequence& one) { return one.suite == suite && one.in_table_iii; }));
}

}  // namespace geoflow::tools
