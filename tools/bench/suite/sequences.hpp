#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/trajectory_file.hpp"

/// The sequences of a data set, as it is unpacked on a disk.
namespace geoflow::tools {

enum class Suite : std::uint8_t { kSim, kTum, kOpenloris, kScannet, kGo2 };

/// "sim", "tum", "openloris", "scannet" or "go2".
[[nodiscard]] std::string_view to_string(Suite suite) noexcept;
[[nodiscard]] std::optional<Suite> suite_of(std::string_view name) noexcept;

/// Which frame's poses a reference holds.
enum class ReferenceFrame : std::uint8_t { kCamera, kBase };

struct Sequence {
  std::string name;                 ///< its path below the data's folder, without `.sens`
  std::filesystem::path recording;  ///< what `geoflow replay` takes
  std::filesystem::path reference;  ///< a trajectory file; empty: the recording holds it itself
  ReferenceFrame frame = ReferenceFrame::kCamera;
};

/// All sequences of the suite below `data`, by name. A folder that is one is not searched further;
/// symbolic links are followed one level. kNotFound, with what was looked for, where there is none.
///
/// What makes a sequence: tum: rgb.txt and depth.txt (or associations.txt) and groundtruth.txt;
/// openloris: color.txt, aligned_depth.txt and groundtruth.txt, which there is base_link's;
/// scannet: a `.sens` file; sim and go2: a rosbag2 folder with groundtruth.txt (camera) or
/// groundtruth_base.txt (base_link).
[[nodiscard]] Result<std::vector<Sequence>> find_sequences(Suite suite,
                                                           const std::filesystem::path& data);

/// What a recording is as a sequence of whichever suite knows its kind, without a name; none where
/// its truth is not with it.
[[nodiscard]] std::optional<Sequence> sequence_at(const std::filesystem::path& recording);

/// The true trajectory of a sequence, on the recording's time line.
[[nodiscard]] Result<TrajectoryFile> read_reference(const Sequence& sequence);

}  // namespace geoflow::tools
