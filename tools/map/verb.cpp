#include "geoflow/tools/verb.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "map/list.hpp"
#include "map/live.hpp"
#include "map/point_file.hpp"

namespace geoflow::tools {
namespace {

constexpr double kDefaultCellM = 0.05;
constexpr double kLeastCellM = 0.001;
constexpr double kLargestCellM = 10;

constexpr std::string_view kExamples =
    R"(  geoflow map info home.map                                 what it holds, every byte checked
  geoflow map info home.map --json                          the same for scripts
  geoflow map export home.map --planes planes.ply           surfaces with normals
  geoflow map export home.map --points p.pcd --keyframes k.txt
                                                            points, and keyframes as TUM text
  geoflow map ls /var/lib/geoflow                           the maps in a folder
  geoflow map save                                          the running daemon's, now
  geoflow map load office.map                               the running daemon goes on in that map
  geoflow map reset                                         the running daemon begins an empty one
A map is made by geoflow replay --save-map or by geoflowd (key map.file). Its format: docs/map-file.md.)";

/// `geoflow map info|export MAP`, `geoflow map ls [FOLDER]`, `geoflow map save|load MAP|reset`.
class MapVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "map"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Look at saved maps, export what they hold; save, load or reset the running daemon's";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }

  void declare(CLI::App& command) override {
    command.require_subcommand(1);
    info_ = command.add_subcommand("info", "What a map holds, and whether it is undamaged");
    add_map(*info_);
    export_ = command.add_subcommand("export", "Write what a map holds in common formats");
    add_map(*export_);
    export_->add_option("--keyframes", keyframes_, "Poses of base_link at the keyframes, TUM text");
    export_->add_option("--points", points_, "Map points, .ply or .pcd text");
    export_->add_option("--planes", planes_, "Surfaces with normals, .ply or .pcd text");
    export_
        ->add_option("--cell", cell_m_, "At most one piece of surface in a cube of this size [m]")
        ->check(CLI::Range(kLeastCellM, kLargestCellM))
        ->capture_default_str();
    list_.declare(command);
    live_.declare(command);
    for (CLI::App* subcommand : command.get_subcommands(nullptr)) {
      subcommand->fallthrough();  // --json is the verb's
      subcommand->footer("Examples:\n" + std::string{kExamples});
    }
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    if (list_.parsed()) {
      return list_.run(console);
    }
    if (live_.parsed()) {
      return live_.run(console);
    }
    const auto map = slam::load_map(map_);
    if (!map) {
      return tl::unexpected{map.error()};
    }
    const auto done = info_->parsed() ? inform(**map, console) : write(**map, console);
    return done.map([] { return ExitCode::kOk; });
  }

 private:
  void add_map(CLI::App& command) { command.add_option("map", map_, "Map file")->required(); }

  [[nodiscard]] Result<void> inform(const slam::StoredMap& map, Console& console) const {
    auto intact = slam::check_depth(map);
    if (!intact) {
      return intact;
    }
    std::error_code none;
    const std::uintmax_t bytes = std::filesystem::file_size(map_, none);
    const slam::MapSummary summary = slam::summary(map);
    const Calibration& calibration = summary.calibration;
    console.object({{"path", map_},
                    {"bytes", bytes},
                    {"made_by", summary.made_by},
                    {"keyframes", summary.keyframes},
                    {"with_depth", summary.with_depth},
                    {"points", summary.points},
                    {"edges", summary.edges},
                    {"parts", summary.parts},
                    {"calibration",
                     {{"source", calibration.source},
                      {"serial", calibration.serial},
                      {"width", calibration.camera.width},
                      {"height", calibration.camera.height}}}});
    constexpr double kBytesPerMiB = 1U << 20U;
    console.line("{}: {:.1f} MiB, undamaged, made by geoflow {}", map_,
                 static_cast<double>(bytes) / kBytesPerMiB, summary.made_by);
    console.line("{} keyframes ({} with depth), {} points, {} edges, {} part{}", summary.keyframes,
                 summary.with_depth, summary.points, summary.edges, summary.parts,
                 summary.parts == 1 ? "" : "s");
    console.line("camera {} x {}, serial {}, calibration: {}", calibration.camera.width,
                 calibration.camera.height,
                 calibration.serial.empty() ? "unknown" : calibration.serial, calibration.source);
    return {};
  }

  [[nodiscard]] Result<void> write(const slam::StoredMap& map, Console& console) const {
    if (keyframes_.empty() && points_.empty() && planes_.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "nothing to export: give --keyframes, --points or --planes");
    }
    Result<void> written;
    if (!keyframes_.empty()) {
      written = write_tum(keyframes_, slam::keyframe_poses(map));
    }
    if (written && !points_.empty()) {
      written = write_points(points_, slam::sparse_points(map));
    }
    if (written && !planes_.empty()) {
      written = slam::planes(map, cell_m_).and_then([&](const auto& surfels) {
        return write_points(planes_, surfels);
      });
    }
    if (written) {
      for (const std::string& path : {keyframes_, points_, planes_}) {
        if (!path.empty()) {
          console.line("written: {}", path);
          console.object({{"written", path}});
        }
      }
    }
    return written;
  }

  CLI::App* info_ = nullptr;
  CLI::App* export_ = nullptr;
  std::string map_;
  std::string keyframes_;
  std::string points_;
  std::string planes_;
  double cell_m_ = kDefaultCellM;
  MapList list_;
  LiveMap live_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_map_verb() {
  return std::make_unique<MapVerb>();
}

}  // namespace geoflow::tools
