#include "geoflow/tools/verb.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"

namespace geoflow::tools {
namespace {

using drivers::BagWriter;
using drivers::RecordedStreams;

/// What happened to the samples of one recording.
struct RecordCounts {
  std::uint64_t written = 0;
  std::uint64_t rejected = 0;
};

Result<void> start_ports(RecordedStreams& streams, BagWriter& writer) {
  auto started = streams.camera().start(writer);
  if (started && streams.imu() != nullptr) {
    started = streams.imu()->start(writer);
  }
  if (started && streams.legs() != nullptr) {
    started = streams.legs()->start(writer);
  }
  return started;
}

drivers::BagWriterOptions writer_options(RecordedStreams& streams, const std::string& output,
                                         bool compress) {
  drivers::BagWriterOptions options{.directory = output, .compress = compress};
  options.camera_stamps = streams.camera().stamps();
  options.imu_stamps = streams.imu() != nullptr ? streams.imu()->stamps() : StampInfo{};
  options.leg_stamps = streams.legs() != nullptr ? streams.legs()->stamps() : StampInfo{};
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
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow record --from kitchen-400 -o kitchen-bag                any recording "
           "becomes a rosbag2\n"
           "  geoflow record --from openloris -o bag --compress               compressed with "
           "Zstandard\n"
           "  geoflow record --from bag -o faulty --faults drops.yaml         with faults put on "
           "it\n"
           "Images, stamps and calibration are read back from the bag as they were, to the bit.";
  }

  void declare(CLI::App& command) override {
    command.add_option("--from", options_.path, "The source: a recording")->required();
    command.add_option("-o,--output", output_, "The bag's folder, which must not exist yet")
        ->required();
    command.add_option("--calibration", calibration_, "Folder with Kalibr files");
    command.add_option("--faults", faults_, "Script of faults to put on the recording");
    command.add_option("--seed", options_.fault_seed, "Seed of the script's random choices");
    command.add_flag("--compress", compress_, "Compress every message");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    options_.calibration =
        calibration_.empty() ? std::nullopt : std::optional<std::filesystem::path>{calibration_};
    options_.faults =
        faults_.empty() ? std::nullopt : std::optional<std::filesystem::path>{faults_};
    auto streams = RecordedStreams::open(options_);
    if (!streams) {
      return tl::unexpected{std::move(streams.error())};
    }
    auto writer =
        BagWriter::create(writer_options(**streams, output_, compress_), (*streams)->calibration());
    if (!writer) {
      return tl::unexpected{std::move(writer.error())};
    }
    const InterruptScope interrupt;
    const auto counts = copy(**streams, **writer, console);
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

 private:
  [[nodiscard]] static Result<RecordCounts> copy(RecordedStreams& streams, BagWriter& writer,
                                                 Console& console) {
    auto started = start_ports(streams, writer);
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
  std::string output_;
  bool compress_ = false;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_record_verb() {
  return std::make_unique<RecordVerb>();
}

}  // namespace geoflow::tools
