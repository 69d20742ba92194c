#include "replay/factory.hpp"

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"

#include "can/log_reader.hpp"
#include "replay/bag/reader.hpp"
#include "replay/euroc/reader.hpp"
#include "replay/oni/reader.hpp"
#include "replay/openloris/reader.hpp"
#include "replay/reader.hpp"
#include "replay/scannet/reader.hpp"
#include "replay/tum/reader.hpp"

namespace geoflow::drivers {
namespace {

using Path = std::filesystem::path;

/// How a format is recognised and opened. The first that fits is taken.
struct Format {
  const char* description;  ///< what it looks for
  bool (*looks_like)(const Path&);
  Result<std::unique_ptr<RecordingReader>> (*open)(const RecordingOptions&);
};

constexpr std::array kFormats = {
    Format{.description = "rosbag2 (metadata.yaml, .db3 or .mcap files)",
           .looks_like = bag::looks_like,
           .open =
               [](const RecordingOptions& options) {
                 return bag::open(options.path, options.topics);
               }},
    Format{.description = "OpenLORIS-Scene (color.txt and aligned_depth.txt)",
           .looks_like = openloris::looks_like,
           .open = [](const RecordingOptions& options) { return openloris::open(options.path); }},
    Format{.description = "TUM RGB-D (rgb.txt and depth.txt, or associations.txt)",
           .looks_like = tum::looks_like,
           .open = [](const RecordingOptions& options) { return tum::open(options.path); }},
    Format{.description = "ScanNet (a .sens file)",
           .looks_like = scannet::looks_like,
           .open = [](const RecordingOptions& options) { return scannet::open(options.path); }},
    Format{.description = "OpenNI (an .oni file)",
           .looks_like = oni::looks_like,
           .open = [](const RecordingOptions& options) { return oni::open(options.path); }},
    Format{.description = "CAN log (a file as candump -L writes it)",
           .looks_like = can::looks_like_log,
           .open =
               [](const RecordingOptions& options) {
                 return can::open_log(options.path, options.can_dictionary);
               }},
    Format{.description =
               "EuRoC IMU (a .csv file, or mav0/imu0/data.csv, imu0/data.csv, imu.csv, data.csv)",
           .looks_like = [](const Path& path) { return euroc::find_csv(path).has_value(); },
           .open = [](const RecordingOptions& options) { return euroc::open(options.path); }},
};

}  // namespace

Result<std::unique_ptr<RecordingReader>> open_recording(const RecordingOptions& options) {
  std::error_code error;
  if (!std::filesystem::exists(options.path, error)) {
    return fail(ErrorCode::kNotFound, "{}: no such recording", options.path.string());
  }
  std::string looked_for;
  for (const Format& format : kFormats) {
    if (format.looks_like(options.path)) {
      return format.open(options);
    }
    looked_for.append(looked_for.empty() ? "" : "; ").append(format.description);
  }
  return fail(ErrorCode::kUnsupported, "{}: not a recording of a known kind. Looked for: {}",
              options.path.string(), looked_for);
}

}  // namespace geoflow::drivers
