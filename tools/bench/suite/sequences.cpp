#include "bench/suite/sequences.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 6;  ///< folders below the data's folder
constexpr std::string_view kTruth = "groundtruth.txt";
constexpr std::string_view kBaseTruth = "groundtruth_base.txt";

bool has(const fs::path& folder, std::string_view file) {
  std::error_code error;
  return fs::is_regular_file(folder / file, error);
}

bool has_bag(const fs::path& folder) {
  std::error_code error;
  return has(folder, "metadata.yaml") ||
         std::ranges::any_of(fs::directory_iterator{folder, error},
                             [](const auto& entry) { return entry.path().extension() == ".db3"; });
}

std::optional<Sequence> tum(const fs::path& place) {
  const bool lists =
      (has(place, "rgb.txt") && has(place, "depth.txt")) || has(place, "associations.txt");
  return lists && has(place, kTruth)
             ? std::optional{Sequence{.name = {}, .recording = place, .reference = place / kTruth}}
             : std::nullopt;
}

std::optional<Sequence> openloris(const fs::path& place) {
  return has(place, "color.txt") && has(place, "aligned_depth.txt") && has(place, kTruth)
             ? std::optional{Sequence{.name = {},
                                      .recording = place,
                                      .reference = place / kTruth,
                                      .frame = ReferenceFrame::kBase}}
             : std::nullopt;
}

std::optional<Sequence> scannet(const fs::path& place) {
  std::error_code error;
  return place.extension() == ".sens" && fs::is_regular_file(place, error)
             ? std::optional{Sequence{.name = {}, .recording = place, .reference = {}}}
             : std::nullopt;
}

std::optional<Sequence> bag(const fs::path& place) {
  const bool base = has(place, kBaseTruth);
  if ((!base && !has(place, kTruth)) || !has_bag(place)) {
    return std::nullopt;
  }
  return has(place, kTruth) ? Sequence{.name = {}, .recording = place, .reference = place / kTruth}
                            : Sequence{.name = {},
                                       .recording = place,
                                       .reference = place / kBaseTruth,
                                       .frame = ReferenceFrame::kBase};
}

struct Kind {
  Suite suite;
  std::string_view name;
  std::string_view looked_for;
  std::optional<Sequence> (*match)(const fs::path&);
};

constexpr std::array kKinds = {
    Kind{.suite = Suite::kSim,
         .name = "sim",
         .looked_for = "folders with a rosbag2 recording and groundtruth.txt",
         .match = bag},
    Kind{.suite = Suite::kTum,
         .name = "tum",
         .looked_for = "folders with rgb.txt, depth.txt and groundtruth.txt",
         .match = tum},
    Kind{.suite = Suite::kOpenloris,
         .name = "openloris",
         .looked_for = "folders with color.txt, aligned_depth.txt and groundtruth.txt",
         .match = openloris},
    Kind{
        .suite = Suite::kScannet, .name = "scannet", .looked_for = ".sens files", .match = scannet},
    Kind{.suite = Suite::kGo2,
         .name = "go2",
         .looked_for =
             "folders with a rosbag2 recording and groundtruth.txt or groundtruth_base.txt",
         .match = bag}};

const Kind& kind_of(Suite suite) {
  return *std::ranges::find(kKinds, suite, &Kind::suite);
}

void search(const Kind& kind, const fs::path& place, int depth, std::vector<Sequence>& found) {
  if (auto sequence = kind.match(place)) {
    found.push_back(*std::move(sequence));
    return;
  }
  std::error_code error;
  if (depth == kDeepest || !fs::is_directory(place, error)) {
    return;
  }
  for (const auto& entry : fs::directory_iterator{place, error}) {
    search(kind, entry.path(), depth + 1, found);
  }
}

std::string name_of(const fs::path& recording, const fs::path& data) {
  fs::path name = recording.lexically_relative(data);
  if (name.empty() || name == ".") {
    name = fs::weakly_canonical(recording).filename();
  }
  // ScanNet's folders and files bear the same name.
  if (name.extension() == ".sens") {
    name = name.parent_path().filename() == name.stem() ? name.parent_path()
                                                        : name.parent_path() / name.stem();
  }
  return name.generic_string();
}

}  // namespace

std::string_view to_string(Suite suite) noexcept {
  return kind_of(suite).name;
}

std::optional<Suite> suite_of(std::string_view name) noexcept {
  const auto* const found = std::ranges::find(kKinds, name, &Kind::name);
  return found == kKinds.end() ? std::nullopt : std::optional{found->suite};
}

Result<std::vector<Sequence>> find_sequences(Suite suite, const fs::path& data) {
  const Kind& kind = kind_of(suite);
  std::error_code error;
  if (!fs::is_directory(data, error)) {
    return fail(ErrorCode::kNotFound, "{}: no such folder", data.string());
  }
  std::vector<Sequence> found;
  search(kind, data, 0, found);
  if (found.empty()) {
    return fail(ErrorCode::kNotFound, "{}: no sequence of the suite {}. Looked for: {}",
                data.string(), kind.name, kind.looked_for);
  }
  for (Sequence& sequence : found) {
    sequence.name = name_of(sequence.recording, data);
  }
  std::ranges::sort(found, {}, &Sequence::name);
  return found;
}

std::optional<Sequence> sequence_at(const fs::path& recording) {
  for (const Kind& kind : kKinds) {
    if (auto sequence = kind.match(recording)) {
      return sequence;
    }
  }
  return std::nullopt;
}

Result<TrajectoryFile> read_reference(const Sequence& sequence) {
  if (!sequence.reference.empty()) {
    return read_trajectory(sequence.reference, TrajectoryFormat::kTum);
  }
  const auto streams = drivers::RecordedStreams::open({.path = sequence.recording});
  if (!streams) {
    return tl::unexpected{streams.error()};
  }
  TrajectoryFile file;
  file.poses = (*streams)->reference();
  if (file.poses.empty()) {
    return fail(ErrorCode::kNotFound, "{}: holds no true poses", sequence.recording.string());
  }
  return file;
}

}  // namespace geoflow::tools
