#include "geoflow/tools/verb.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/output_files.hpp"
#include "geoflow/tools/page.hpp"
#include "geoflow/tools/plot.hpp"

#include "bench/suite/sequences.hpp"
#include "report/accuracy.hpp"
#include "report/assets.hpp"
#include "report/document.hpp"
#include "report/run_directory.hpp"
#include "report/streams.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::string_view kCategory = "report";
constexpr std::string_view kPage = "report.html";

/// `geoflow report RUN -o DIR`.
class ReportVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "report"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Make a page of a run: trajectory, errors, covariance, times, gaps";
  }
  [[nodiscard]] std::string_view examples() const override;
  void declare(CLI::App& command) override;
  [[nodiscard]] Result<ExitCode> run(Console& console) override;

 private:
  [[nodiscard]] Result<void> add_table(ReportContent& content) const;
  /// A truth that was named must do; one that lies with the recording need not.
  [[nodiscard]] Result<void> add_accuracy(ReportContent& content) const;
  static void take(Accuracy accuracy, ReportContent& content);
  void add_times(ReportContent& content, Console& console) const;
  [[nodiscard]] Result<void> write(const ReportContent& content, Console& console) const;
  static void say(const ReportContent& content, const json& written, Console& console);

  std::string run_;
  std::string output_;
  std::string reference_;
  std::optional<ReferenceFrame> frame_;
  std::string recording_;
  std::string calibration_;
  std::string table_;
};

std::string_view ReportVerb::examples() const {
  return "  geoflow replay bag -o out && geoflow report out -o page\n"
         "      page/report.html, one file that needs no network, and each plot as .png\n"
         "  geoflow report out -o page --reference groundtruth.txt\n"
         "      against this truth (default: the one that lies with the recording)\n"
         "  geoflow report out -o page --recording /elsewhere/bag --table "
         "out/table-sim/table.json\n"
         "      the recording has moved; with the ablation that geoflow bench table measured";
}

void ReportVerb::declare(CLI::App& command) {
  const std::map<std::string, ReferenceFrame> frames{{"camera", ReferenceFrame::kCamera},
                                                     {"base", ReferenceFrame::kBase}};
  command.add_option("RUN", run_, "Folder that geoflow replay wrote")->required();
  command.add_option("-o,--output", output_, "Folder for the page; made if it is not there")
      ->required();
  command.add_option("--reference", reference_,
                     "True trajectory (default: the one that lies with the recording)");
  command
      .add_option("--reference-frame", frame_,
                  "Whose poses --reference has: camera or base (default: base for a "
                  "groundtruth_base.txt, else camera)")
      ->transform(CLI::CheckedTransformer(frames).description(""));
  command.add_option("--recording", recording_,
                     "The recording, where it is no longer as the run says");
  command.add_option("--calibration", calibration_, "Folder with the recording's Kalibr files");
  command.add_option("--table", table_, "table.json of geoflow bench table, for the ablation");
}

Result<ExitCode> ReportVerb::run(Console& console) {
  auto run = read_run(run_);
  if (!run) {
    return tl::unexpected{std::move(run.error())};
  }
  ReportContent content{.run = *std::move(run)};
  if (recording_.empty()) {
    recording_ = content.run.recording().string();
  }
  const InterruptScope interrupt;
  return add_table(content)
      .and_then([&] { return add_accuracy(content); })
      .and_then([&] {
        add_times(content, console);
        return write(content, console);
      })
      .map([&] { return InterruptScope::requested() ? ExitCode::kInterrupted : ExitCode::kOk; });
}

Result<void> ReportVerb::add_table(ReportContent& content) const {
  if (table_.empty()) {
    return {};
  }
  auto table = read_json(table_);
  if (!table) {
    return tl::unexpected{std::move(table.error())};
  }
  if (!table->is_object() || !table->contains("summary") || !table->at("summary").is_array()) {
    return fail(ErrorCode::kInvalidData, "{}: the key \"summary\" should be an array", table_);
  }
  content.ablation = *std::move(table);
  return {};
}

Result<void> ReportVerb::add_accuracy(ReportContent& content) const {
  if (!reference_.empty()) {
    return read_named_reference(reference_, frame_)
        .and_then([&](const Reference& truth) { return measure_accuracy(content.run, truth); })
        .map([&](Accuracy accuracy) { take(std::move(accuracy), content); });
  }
  const auto truth = find_reference(recording_);
  if (!truth) {
    content.warnings.push_back("No comparison with the truth: " + truth.error().message);
    return {};
  }
  const auto& reference = *truth;
  if (!reference) {
    content.warnings.emplace_back(
        "No comparison with the truth: none lies with the recording (--reference names one).");
    return {};
  }
  auto accuracy = measure_accuracy(content.run, *reference);
  if (accuracy) {
    take(*std::move(accuracy), content);
  } else {
    content.warnings.push_back("No comparison with the truth: " + accuracy.error().message);
  }
  return {};
}

void ReportVerb::take(Accuracy accuracy, ReportContent& content) {
  for (const std::string& warning : accuracy.last.warnings) {
    content.warnings.push_back(warning);
  }
  if (!accuracy.normalised) {
    content.warnings.push_back("No comparison with the covariances: " +
                               accuracy.normalised.error().message);
  }
  content.accuracy = std::move(accuracy);
}

void ReportVerb::add_times(ReportContent& content, Console& console) const {
  auto times = read_times(recording_, calibration_, [&](std::uint64_t samples) {
    console.progress(samples, 0, "samples of the recording");
    return !InterruptScope::requested();
  });
  console.end_progress();
  if (!times) {
    content.warnings.push_back("No sensor gaps: " + times.error().message);
  } else if (times->streams.empty()) {
    content.warnings.push_back(fmt::format("No sensor gaps: {} has no samples", recording_));
  } else {
    content.times = *std::move(times);
  }
}

Result<void> ReportVerb::write(const ReportContent& content, Console& console) const {
  for (const std::string& warning : content.warnings) {
    log::warning(kCategory, "{}", warning);
  }
  const fs::path folder{output_};
  if (auto prepared = prepare_output(folder); !prepared) {
    return prepared;
  }
  const std::vector<Section> sections = report_sections(content);
  json written = json::array({(folder / kPage).string()});
  for (const Section& section : sections) {
    if (section.figure) {
      const fs::path png = folder / section.figure->png;
      if (auto saved = save_figure(section.figure->figure, png); !saved) {
        return saved;
      }
      written.push_back(png.string());
    }
  }
  const std::string page =
      fill_page(report_page(), {{"page.css", page_styles()},
                                {"plot.js", plot_script()},
                                {"report.js", report_script()},
                                {"data", json_for_page(page_data(content, sections))}});
  return replace_file(folder / kPage, page).map([&] { say(content, written, console); });
}

void ReportVerb::say(const ReportContent& content, const json& written, Console& console) {
  json object{{"written", written}, {"warnings", content.warnings}};
  for (const json& file : written) {
    console.line("{}", file.get<std::string>());
  }
  if (content.accuracy) {
    const Accuracy& accuracy = *content.accuracy;
    object["reference"] = accuracy.reference;
    object["live"] = to_json(accuracy.live, accuracy.options);
    object["final"] = to_json(accuracy.last, accuracy.options);
    if (accuracy.normalised) {
      object["consistency"] = to_json(consistency(*accuracy.normalised));
    }
  }
  console.object(object);
}

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_report_verb() {
  return std::make_unique<ReportVerb>();
}

}  // namespace geoflow::tools
