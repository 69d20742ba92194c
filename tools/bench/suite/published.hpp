#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>

/// The figures of GeoFlow-SLAM's paper, tables I to IV and section V-C, to stand beside measured
/// ones.
namespace geoflow::tools {

/// One sequence of the paper.
struct PublishedSequence {
  std::string_view suite;
  std::string_view ending;        ///< of the sequence's name
  std::optional<double> ate_m{};  ///< of the whole method; none: only the mean is published
  bool in_table_iii = false;      ///< one of those that the means are taken over
};

/// Means over the sequences of table III.
struct PublishedMean {
  std::string_view suite;
  std::string_view row;
  double ate_m = 0;
  double rte_m = 0;
};

/// The paper's sequence of this name, as its data set's folders are called; null for others.
[[nodiscard]] const PublishedSequence* find_published(std::string_view suite,
                                                      std::string_view name) noexcept;

/// Null where the paper has none.
[[nodiscard]] const PublishedMean* find_published_mean(std::string_view suite,
                                                       std::string_view row) noexcept;

/// How many sequences of table III the suite has.
[[nodiscard]] std::size_t table_iii_size(std::string_view suite) noexcept;

}  // namespace geoflow::tools
