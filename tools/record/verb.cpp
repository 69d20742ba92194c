#include "geoflow/tools/verb.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/sources.hpp"
#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"

#include "record/live_recorder.hpp"
#include "record/sample_queue.hpp"

namespace geoflow::tools {
namespace {

using drivers::BagWriter;
using drivers::RecordedStreams;

constexpr std::string_view kExamples =
    "  geoflow record --from kitchen-400 -o kitchen-bag          any recording becomes a "
    "bag\n"
    "  geoflow record --from openloris -o bag --compress         compressed with Zstandard\n"
    "  geoflow record --from bag -o walk --mcap                  as MCAP, for Foxglove\n"
    "  geoflow record --from bag -o faulty --faults drops.yaml   with faults put on it\n"
    "  geoflow record --live --set source.camera=d435i -o walk   a camera, until Ctrl-C\n"
    "  geoflow record --live --config g.toml -o walk             what the daemon has\n"
    "Images, stamps and calibration are read back from the bag as they were, to the bit. "
    "Live, the sources are\nthose of the daemon's configuration; a bag is whole up to its "
    "last second however the recording ends.";

constexpr double kShortest_s = 1e-3;
constexpr double kLongest_s = 1e9;

/// What happened to the samples of one recording.
struct RecordCounts {
  std::uint64_t written = 0;
  std::uint64_t rejected = 0;
};

drivers::BagWriterOptions writer_options(const daemon::Ports& ports, const std::string& output,
                                         bool compress, bool mcap) {
  drivers::BagWriterOptions options{.directory = output, .compress = compress};
  const auto stamps = [](const auto* port) {
    return port != nullptr ? port->stamps() : StampInfo{};
  };
  options.storage = mcap ? drivers::BagStorage::kMcap : drivers::BagStorage::kSqlite;
  options.camera_stamps = stamps(ports.camera);
  options.imu_stamps = stamps(ports.imu);
  options.leg_stamps = stamps(ports.legs);
  return options;
}

std::uint64_t total_samples(const drivers::RecordingInfo& info) {
  std::uint64_t total = 0;
  for (const auto& stream : info.streams) {
    total += stream.stream ? stream.count : 0;
  }
  return total;
}

class RecordVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "record"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Write a source's samples to a rosbag2 directory";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }

  void declare(CLI::App& command) override {
    auto* from = command.add_option("--from", options_.path, "The source: a recording");
    auto* live = command.add_flag("--live", live_, "The source: the devices of the configuration")
                     ->excludes(from);
    command.add_option("-o,--output", output_, "The bag's folder, which must not exist yet")
        ->required();
    command.add_option("--calibration", calibration_, "Folder with Kalibr files");
    command.add_option("--faults", faults_, "Script of faults to put on the recording")
        ->needs(from);
    command.add_option("--seed", options_.fault_seed, "Seed of the script's random choices")
        ->needs(from);
    command.add_option("--config", config_file_, "The daemon's TOML file")->needs(live);
    command
        .add_option("--set", settings_,
                    "Overrides one key of the configuration, section.key=value; repeatable")
        ->allow_extra_args(false)
        ->needs(live);
    command.add_option("--duration", duration_s_, "Ends after so long [s]; else by Ctrl-C")
        ->check(CLI::Range(kShortest_s, kLongest_s))
        ->needs(live);
    command
        .add_flag("--gray", gray_,
                  "Colour as gray: a third of the bytes, and what the "
                  "estimator sees")
        ->needs(live);
    command.add_flag("--compress", compress_, "Compress every message, in MCAP every chunk");
    command.add_flag("--mcap", mcap_, "MCAP storage, which Foxglove opens as it is; else SQLite");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    if (!live_ && options_.path.empty()) {
      return fail(ErrorCode::kInvalidArgument, "one of --from RECORDING and --live is needed");
    }
    return live_ ? run_live(console) : run_copy(console);
  }

 private:
  [[nodiscard]] Result<ExitCode> run_copy(Console& console) {
    options_.calibration =
        calibration_.empty() ? std::nullopt : std::optional<std::filesystem::path>{calibration_};
    options_.faults =
        faults_.empty() ? std::nullopt : std::optional<std::filesystem::path>{faults_};
    auto streams = RecordedStreams::open(options_);
    if (!streams) {
      return tl::unexpected{std::move(streams.error())};
    }
    daemon::Sources source{.streams = std::move(*streams)};
    auto writer = BagWriter::create(writer_options(source.ports(), output_, compress_, mcap_),
                                    source.streams->calibration());
    if (!writer) {
      return tl::unexpected{std::move(writer.error())};
    }
    const InterruptScope interrupt;
    const auto counts = copy(source, **writer, console);
    console.end_progress();
    auto closed = (*writer)->close();
    if (!counts || !closed) {
      return tl::unexpected{counts ? closed.error() : counts.error()};
    }
    console.object({{"output", output_},
                    {"samples", counts->written},
                    {"rejected", counts->rejected},
                    {"interrupted", InterruptScope::requested()}});
    console.line("{} samples written to {}, {} could not be read", counts->written, output_,
                 counts->rejected);
    return InterruptScope::requested() ? ExitCode::kInterrupted : ExitCode::kOk;
  }

  [[nodiscard]] Result<ExitCode> run_live(Console& console) const {
    auto sources = open_live();
    if (!sources) {
      return tl::unexpected{std::move(sources.error())};
    }
    auto writer = BagWriter::create(writer_options(sources->ports(), output_, compress_, mcap_),
                                    sources->calibration);
    if (!writer) {
      return tl::unexpected{std::move(writer.error())};
    }
    const InterruptScope interrupt;
    const HostTime end = HostClock::now() + from_seconds(duration_s_);
    const auto counts =
        record_live(*sources, **writer, QueueLimits{}, [&](const LiveCounts& so_far) {
          console.progress(so_far.total(), 0, "samples");
          const bool over = duration_s_ > 0 && HostClock::now() >= end;
          return !over && !InterruptScope::requested();
        });
    console.end_progress();
    auto closed = (*writer)->close();
    if (!counts || !closed) {
      return tl::unexpected{counts ? closed.error() : counts.error()};
    }
    report(*counts, console);
    return duration_s_ > 0 && InterruptScope::requested() ? ExitCode::kInterrupted : ExitCode::kOk;
  }

  /// The sources of the daemon's configuration, all of them devices.
  [[nodiscard]] Result<daemon::Sources> open_live() const {
    auto config = daemon::configure(config_file_, settings_);
    if (!config) {
      return tl::unexpected{std::move(config.error())};
    }
    config->source.replay.clear();
    config->source.realtime = true;
    if (!calibration_.empty()) {
      config->source.calibration = calibration_;
    }
    const auto& source = config->source;
    if (source.camera.empty() && source.legs.empty() && source.imu.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "no device is named: set source.camera, source.legs or source.imu, in a file "
                  "(--config) or by --set source.camera=d435i");
    }
    return daemon::open_sources(*config, gray_ ? PixelFormat::kGray8 : PixelFormat::kBgr8);
  }

  void report(const LiveCounts& counts, Console& console) const {
    nlohmann::json streams = nlohmann::json::object();
    std::string text;
    for (std::size_t i = 0; i < counts.written.size(); ++i) {
      const std::string_view name = drivers::name(static_cast<drivers::StreamId>(i));
      if (counts.written.at(i) > 0) {
        streams[std::string{name}] = counts.written.at(i);
        text += fmt::format("{}{} {}", text.empty() ? "" : ", ", counts.written.at(i), name);
      }
    }
    console.object({{"output", output_},
                    {"samples", counts.total()},
                    {"streams", streams},
                    {"dropped", counts.dropped},
                    {"interrupted", InterruptScope::requested()}});
    console.line("{} samples written to {} ({})", counts.total(), output_,
                 text.empty() ? "nothing came" : text);
    if (counts.dropped > 0) {
      console.line("{} samples were lost: the disk was too slow; --gray and --compress write less",
                   counts.dropped);
    }
  }

  [[nodiscard]] static Result<RecordCounts> copy(daemon::Sources& source, BagWriter& writer,
                                                 Console& console) {
    RecordedStreams& streams = *source.streams;
    daemon::StartedPorts ports{source.ports()};
    auto started = ports.start(writer);
    if (!started) {
      return tl::unexpected{std::move(started.error())};
    }
    const std::uint64_t total = total_samples(streams.info());
    RecordCounts counts;
    bool more = true;
    while (more && !InterruptScope::requested()) {
      const auto stepped = streams.step();
      counts.rejected += stepped ? 0U : 1U;
      counts.written += stepped && *stepped ? 1U : 0U;
      more = !stepped || *stepped;
      if (auto status = writer.status(); !status) {
        return tl::unexpected{std::move(status.error())};
      }
      console.progress(counts.written, total, "samples");
    }
    return counts;
  }

  drivers::RecordingOptions options_;
  std::string calibration_;
  std::string faults_;
  std::string config_file_;
  std::vector<std::string> settings_;
  std::string output_;
  double duration_s_ = 0;  ///< 0: until it is interrupted
  bool live_ = false;
  bool gray_ = false;
  bool compress_ = false;
  bool mcap_ = false;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_record_verb() {
  return std::make_unique<RecordVerb>();
}

}  // namespace geoflow::tools
