#include "replay/faults/script.hpp"

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>
#include <toml++/toml.h>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/toml_text.hpp"

#include "replay/text.hpp"

namespace geoflow::drivers::faults {
namespace {

constexpr std::size_t kMostFaults = 64;
constexpr std::size_t kLargestScript = std::size_t{1} << 20U;
constexpr double kLongestTimeS = 1e6;
constexpr double kLongestDelayS = 10;
constexpr double kMostDriftPpm = 1e5;
constexpr double kWrapPeriodS = 4294.967296;

using Streams = std::bitset<kStreamCount>;
using Kinds = std::uint32_t;

constexpr Kinds bit(FaultKind kind) {
  return Kinds{1} << static_cast<unsigned>(kind);
}
template <typename... Kind>
constexpr Kinds any_of(Kind... kinds) {
  return (bit(kinds) | ...);
}

constexpr Kinds kClockKinds = any_of(FaultKind::kClockOffset, FaultKind::kClockDrift,
                                     FaultKind::kClockJump, FaultKind::kClockWrap);
constexpr Kinds kEveryKind = bit(static_cast<FaultKind>(kFaultKindCount)) - 1;
constexpr Kinds kRandomKinds = kEveryKind & ~kClockKinds & ~bit(FaultKind::kGap);

/// A key with a number: where it goes, which kinds use it, which need it, and its range.
struct NumberKey {
  std::string_view name;
  void (*store)(Fault&, double);
  Kinds used_by;
  Kinds needed_by;
  double least;
  double most;
};

constexpr std::array kNumberKeys = {
    NumberKey{.name = "probability",
              .store = [](Fault& f, double v) { f.probability = v; },
              .used_by = kRandomKinds,
              .needed_by = 0,
              .least = 0,
              .most = 1},
    NumberKey{.name = "from_s",
              .store = [](Fault& f, double v) { f.from = from_seconds(v); },
              .used_by = kEveryKind & ~bit(FaultKind::kClockWrap),
              .needed_by = any_of(FaultKind::kGap, FaultKind::kClockJump),
              .least = 0,
              .most = kLongestTimeS},
    NumberKey{.name = "until_s",
              .store = [](Fault& f, double v) { f.until = from_seconds(v); },
              .used_by = kEveryKind & ~any_of(FaultKind::kClockWrap, FaultKind::kClockJump),
              .needed_by = bit(FaultKind::kGap),
              .least = 0,
              .most = kLongestTimeS},
    NumberKey{.name = "delay_s",
              .store = [](Fault& f, double v) { f.delay = from_seconds(v); },
              .used_by = bit(FaultKind::kDelay),
              .needed_by = bit(FaultKind::kDelay),
              .least = 0,
              .most = kLongestDelayS},
    NumberKey{.name = "jitter_s",
              .store = [](Fault& f, double v) { f.jitter = from_seconds(v); },
              .used_by = bit(FaultKind::kDelay),
              .needed_by = 0,
              .least = 0,
              .most = kLongestDelayS},
    NumberKey{.name = "keep",
              .store = [](Fault& f, double v) { f.keep = v; },
              .used_by = bit(FaultKind::kTruncate),
              .needed_by = 0,
              .least = 0,
              .most = 1},
    NumberKey{.name = "offset_s",
              .store = [](Fault& f, double v) { f.offset = from_seconds(v); },
              .used_by = bit(FaultKind::kClockOffset),
              .needed_by = bit(FaultKind::kClockOffset),
              .least = -kLongestTimeS,
              .most = kLongestTimeS},
    NumberKey{.name = "jump_s",
              .store = [](Fault& f, double v) { f.offset = from_seconds(v); },
              .used_by = bit(FaultKind::kClockJump),
              .needed_by = bit(FaultKind::kClockJump),
              .least = -kLongestTimeS,
              .most = kLongestTimeS},
    NumberKey{.name = "drift_ppm",
              .store = [](Fault& f, double v) { f.drift_ppm = v; },
              .used_by = bit(FaultKind::kClockDrift),
              .needed_by = bit(FaultKind::kClockDrift),
              .least = -kMostDriftPpm,
              .most = kMostDriftPpm},
    NumberKey{.name = "first_wrap_s",
              .store = [](Fault& f, double v) { f.first_wrap = from_seconds(v); },
              .used_by = bit(FaultKind::kClockWrap),
              .needed_by = bit(FaultKind::kClockWrap),
              .least = 0,
              .most = kWrapPeriodS},
};

Streams only(std::initializer_list<StreamId> streams) {
  Streams set;
  for (const StreamId stream : streams) {
    set.set(static_cast<std::size_t>(stream));
  }
  return set;
}

std::optional<FaultKind> kind_of(std::string_view text) {
  for (std::size_t i = 0; i < kFaultKindCount; ++i) {
    if (name(static_cast<FaultKind>(i)) == text) {
      return static_cast<FaultKind>(i);
    }
  }
  return std::nullopt;
}

std::optional<Streams> streams_of(std::string_view text) {
  if (text == "camera") {
    return only({StreamId::kColor, StreamId::kDepth});
  }
  for (std::size_t i = 0; i < kStreamCount; ++i) {
    if (name(static_cast<StreamId>(i)) == text) {
      return only({static_cast<StreamId>(i)});
    }
  }
  return std::nullopt;
}

/// Reads one [[fault]] table. Holds what its errors must name.
class TableReader {
 public:
  TableReader(std::string_view file, const toml::table& table) : file_{file}, table_{table} {}

  Result<Fault> read() {
    Fault fault;
    auto done = read_kind(fault);
    done = done ? read_streams(fault) : done;
    done = done ? read_keys(fault) : done;
    done = done ? check_needed(fault) : done;
    if (!done) {
      return tl::unexpected{std::move(done.error())};
    }
    if (fault.until <= fault.from) {
      return wrong(table_, "until_s", "must be later than from_s");
    }
    return fault;
  }

 private:
  [[nodiscard]] tl::unexpected<Error> wrong(const toml::node& node, std::string_view key,
                                            std::string_view what) const {
    return fail(ErrorCode::kInvalidArgument, "{}:{}: {}: {}", file_, node.source().begin.line, key,
                what);
  }

  [[nodiscard]] Result<std::string_view> word(std::string_view key) const {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return wrong(table_, key, "is missing");
    }
    const auto* text = node->as_string();
    if (text == nullptr) {
      return wrong(*node, key, "a word in quotes is expected");
    }
    return std::string_view{text->get()};
  }

  [[nodiscard]] Result<void> read_kind(Fault& fault) const {
    const auto text = word("kind");
    if (!text) {
      return tl::unexpected{text.error()};
    }
    const auto kind = kind_of(*text);
    if (!kind) {
      std::string known;
      for (std::size_t i = 0; i < kFaultKindCount; ++i) {
        known.append(i == 0 ? "" : ", ").append(name(static_cast<FaultKind>(i)));
      }
      return wrong(*table_.get("kind"), "kind", fmt::format("'{}' is none of {}", *text, known));
    }
    fault.kind = *kind;
    return {};
  }

  [[nodiscard]] Result<void> read_streams(Fault& fault) const {
    const auto text = word("stream");
    if (!text) {
      return tl::unexpected{text.error()};
    }
    const auto streams = streams_of(*text);
    const toml::node& node = *table_.get("stream");
    if (!streams) {
      return wrong(
          node, "stream",
          fmt::format("'{}' is none of color, depth, camera, imu, legs, body_velocity", *text));
    }
    fault.streams = *streams;
    const Kinds kind = bit(fault.kind);
    if ((kind & kClockKinds) != 0 && *text != "camera" && *text != "imu" && *text != "legs") {
      return wrong(node, "stream", "the clocks are those of camera, imu and legs");
    }
    if ((kind & kClockKinds) != 0 && *text == "legs") {
      fault.streams = only({StreamId::kLegs, StreamId::kBodyVelocity});
    }
    const bool images = (*streams & only({StreamId::kColor, StreamId::kDepth})).any();
    const bool for_images = fault.kind == FaultKind::kTruncate || fault.kind == FaultKind::kCover;
    if (for_images && !images) {
      return wrong(node, "stream",
                   fmt::format("{} is for images: color, depth or camera", name(fault.kind)));
    }
    if (fault.kind == FaultKind::kNan && images) {
      return wrong(node, "stream", "nan is for imu, legs and body_velocity");
    }
    return {};
  }

  [[nodiscard]] Result<void> read_keys(Fault& fault) const {
    for (const auto& [key, node] : table_) {
      const std::string_view text = key.str();
      if (text == "kind" || text == "stream") {
        continue;
      }
      if (auto read = read_number(text, node, fault); !read) {
        return read;
      }
    }
    return {};
  }

  [[nodiscard]] Result<void> read_number(std::string_view key, const toml::node& node,
                                         Fault& fault) const {
    for (const NumberKey& known : kNumberKeys) {
      if (known.name != key) {
        continue;
      }
      if ((known.used_by & bit(fault.kind)) == 0) {
        return wrong(node, key, fmt::format("is not used by {}", name(fault.kind)));
      }
      const auto value = node.value<double>();
      if (!value || !(*value >= known.least && *value <= known.most)) {
        return wrong(node, key,
                     fmt::format("a number from {} to {} is expected", known.least, known.most));
      }
      known.store(fault, *value);
      return {};
    }
    return wrong(node, key, "an unknown key");
  }

  [[nodiscard]] Result<void> check_needed(const Fault& fault) const {
    for (const NumberKey& known : kNumberKeys) {
      if ((known.needed_by & bit(fault.kind)) != 0 && table_.get(known.name) == nullptr) {
        return wrong(table_, known.name, fmt::format("is missing, {} needs it", name(fault.kind)));
      }
    }
    return {};
  }

  std::string_view file_;
  const toml::table& table_;
};

Result<std::vector<Fault>> read_array(std::string_view file, const toml::array& array) {
  std::vector<Fault> faults;
  for (const toml::node& node : array) {
    const auto line = node.source().begin.line;
    if (!node.is_table()) {
      return fail(ErrorCode::kInvalidArgument, "{}:{}: fault: a [[fault]] table is expected", file,
                  line);
    }
    if (faults.size() == kMostFaults) {
      return fail(ErrorCode::kInvalidArgument, "{}:{}: fault: at most {} are allowed", file, line,
                  kMostFaults);
    }
    auto fault = TableReader{file, *node.as_table()}.read();
    if (!fault) {
      return tl::unexpected{std::move(fault.error())};
    }
    faults.push_back(*fault);
  }
  return faults;
}

Result<std::vector<Fault>> read_top(std::string_view file, const toml::table& top) {
  Result<std::vector<Fault>> faults;
  for (const auto& [key, node] : top) {
    const auto line = node.source().begin.line;
    if (key.str() != "fault") {
      return fail(ErrorCode::kInvalidArgument,
                  "{}:{}: {}: an unknown key, only [[fault]] tables are expected", file, line,
                  key.str());
    }
    if (!node.is_array()) {
      return fail(ErrorCode::kInvalidArgument,
                  "{}:{}: fault: [[fault]] with two brackets is expected", file, line);
    }
    faults = read_array(file, *node.as_array());
  }
  return faults;
}

}  // namespace

Result<std::vector<Fault>> parse_script(std::string_view file, std::string_view content) {
  if (auto checked = check_toml_text(file, content); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  try {
    return read_top(file, toml::parse(content, file));
  } catch (const toml::parse_error& error) {
    return fail(ErrorCode::kInvalidArgument, "{}:{}: not TOML: {}", file, error.source().begin.line,
                error.description());
  } catch (const std::exception& exception) {
    return fail(ErrorCode::kInvalidArgument, "{}: {}", file, exception.what());
  }
}

Result<std::vector<Fault>> load_script(const std::filesystem::path& path) {
  return text::read_file(path, kLargestScript).and_then([&](const std::string& content) {
    return parse_script(path.string(), content);
  });
}

}  // namespace geoflow::drivers::faults
