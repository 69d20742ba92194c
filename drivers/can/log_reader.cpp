#include "can/log_reader.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/candump.hpp"
#include "can/leg_dictionary.hpp"
#include "can/snapshot.hpp"
#include "replay/line_file.hpp"
#include "replay/reader.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers::can {
namespace {

/// The snapshots of a log, one after another.
class Snapshots {
 public:
  Snapshots(text::LineFile file, const LegDictionary& dictionary)
      : file_{std::move(file)}, assembler_{dictionary} {}

  /// The next snapshot; none at the end. An Error concerns one line; the next call goes on.
  Result<std::optional<Arrival<LegClock, LegSample>>> next() {
    while (true) {
      if (const auto snapshot = assembler_.pop(now_)) {
        return snapshot;
      }
      if (ended_) {
        return std::nullopt;
      }
      auto line = file_.next();
      if (!line) {
        return tl::unexpected{std::move(line.error())};
      }
      const std::optional<text::Line>& found = *line;
      if (!found) {
        ended_ = true;
        assembler_.finish();
        continue;
      }
      auto parsed = parse_log_line(found->text);
      if (!parsed) {
        return tl::unexpected{std::move(parsed.error()).in(file_.where())};
      }
      now_ = HostTime{parsed->stamp};
      (void)assembler_.push({.frame = parsed->frame, .t_arrival = now_});
    }
  }

  [[nodiscard]] StampInfo stamps() const { return assembler_.stamps(); }

 private:
  text::LineFile file_;
  SnapshotAssembler assembler_;
  HostTime now_;
  bool ended_ = false;
};

class Reader final : public RecordingReader {
 public:
  Reader(std::unique_ptr<LegDictionary> dictionary, text::LineFile file, RecordingInfo info)
      : dictionary_{std::move(dictionary)},
        snapshots_{std::move(file), *dictionary_},
        info_{std::move(info)} {}

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }
  [[nodiscard]] RecordingStamps stamps() const override { return {.legs = snapshots_.stamps()}; }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    return snapshots_.next().map([](const auto& snapshot) {
      return snapshot ? std::optional<Event>{*snapshot} : std::nullopt;
    });
  }

 private:
  std::unique_ptr<LegDictionary> dictionary_;
  Snapshots snapshots_;
  RecordingInfo info_;
};

/// Reads the log once for what info() says.
Result<RecordingInfo> survey(const std::filesystem::path& path, const LegDictionary& dictionary) {
  auto file = text::LineFile::open(path);
  if (!file) {
    return tl::unexpected{std::move(file.error())};
  }
  Snapshots snapshots{*std::move(file), dictionary};
  std::uint64_t count = 0;
  std::optional<HostTime> start;
  HostTime end;
  for (auto next = snapshots.next(); !next || next->has_value(); next = snapshots.next()) {
    if (const auto snapshot = next.value_or(std::nullopt)) {
      start = start.value_or(snapshot->t_arrival);
      end = snapshot->t_arrival;
      ++count;
    }
  }
  if (!start) {
    return fail(ErrorCode::kInvalidData, "{}: by the dictionary {} no frame there is of a leg",
                path.string(), dictionary.name());
  }
  return RecordingInfo{.format = "candump",
                       .start = *start,
                       .end = end,
                       .streams = {{.name = path.filename().string(),
                                    .type = "legs",
                                    .count = count,
                                    .stream = StreamId::kLegs}}};
}

/// The only .dbc file in the log's folder.
std::optional<std::filesystem::path> dictionary_beside(const std::filesystem::path& log) {
  std::optional<std::filesystem::path> found;
  std::error_code error;
  const std::filesystem::path folder = log.has_parent_path() ? log.parent_path() : ".";
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".dbc") {
      if (found) {
        return std::nullopt;
      }
      found = entry->path();
    }
  }
  return found;
}

}  // namespace

bool looks_like_log(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return false;
  }
  auto file = text::LineFile::open(path);
  if (!file) {
    return false;
  }
  const auto line = file->next();
  const std::optional<text::Line> first = line.value_or(std::nullopt);
  return first && parse_log_line(first->text).has_value();
}

Result<std::unique_ptr<RecordingReader>> open_log(
    const std::filesystem::path& path, const std::optional<std::filesystem::path>& dictionary) {
  const auto file_of_dictionary = dictionary ? dictionary : dictionary_beside(path);
  auto loaded = LegDictionary::load(file_of_dictionary.value_or(std::filesystem::path{}));
  if (!loaded) {
    return tl::unexpected{std::move(loaded.error())};
  }
  auto info = survey(path, *loaded);
  auto file = text::LineFile::open(path);
  if (!info || !file) {
    return tl::unexpected{info ? std::move(file.error()) : std::move(info.error())};
  }
  return std::make_unique<Reader>(std::make_unique<LegDictionary>(*std::move(loaded)),
                                  *std::move(file), *std::move(info));
}

}  // namespace geoflow::drivers::can
