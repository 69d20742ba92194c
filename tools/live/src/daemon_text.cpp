#include "geoflow/tools/daemon_text.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/words.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr double kPercent = 100;

const json* find(const json& object, const std::string& path) {
  const json* value = &object;
  std::size_t begin = 0;
  while (begin <= path.size()) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    const auto found = value->find(path.substr(begin, end - begin));
    if (!value->is_object() || found == value->end()) {
      return nullptr;
    }
    value = &*found;
    begin = end + 1;
  }
  return value;
}

std::string source_line(const json& status) {
  const std::string path = text_at(status, "source.path");
  std::string line = "source   ";
  line += path.empty() ? text_at(status, "source.format")
                       : fmt::format("{} ({})", path, text_at(status, "source.format"));
  if (const std::string trouble = text_at(status, "source.trouble"); !trouble.empty()) {
    return line + ", not open: " + trouble;
  }
  const std::string calibration = text_at(status, "source.calibration");
  return calibration.empty() ? line + ", being opened" : line + ", calibration: " + calibration;
}

std::string frames_line(const json& status) {
  const double frames = number_at(status, "frames");
  const double tracked = number_at(status, "tracked");
  return fmt::format(
      "frames   {:.0f}, with a pose {:.0f} ({:.1f} %); dropped: colour {:.0f}, depth {:.0f}, "
      "samples "
      "{:.0f}, packets {:.0f}; rejected {:.0f}",
      frames, tracked, frames > 0 ? kPercent * tracked / frames : 0,
      number_at(status, "drops.color"), number_at(status, "drops.depth"),
      number_at(status, "drops.samples"), number_at(status, "drops.packets"),
      number_at(status, "rejected"));
}

std::string latency_line(const json& status) {
  return fmt::format("latency  from a frame's arrival to its pose {:.0f} ms, 99 % within {:.0f} ms",
                     number_at(status, "times_ms.arrival_to_pose.p50"),
                     number_at(status, "times_ms.arrival_to_pose.p99"));
}

std::string map_line(const json& status) {
  const std::string file = text_at(status, "map.file");
  if (file.empty()) {
    return "map      not kept: no map.file is configured";
  }
  std::string line = "map      " + file;
  if (const json* saved = find(status, "map.saved_s"); saved != nullptr && saved->is_number()) {
    line += fmt::format(", saved {} ago: {:.0f} keyframes, {}",
                        daemon::in_words(from_seconds(saved->get<double>())),
                        number_at(status, "map.keyframes"),
                        bytes_in_words(static_cast<std::uint64_t>(number_at(status, "map.bytes"))));
  } else {
    line += ", not saved yet";
  }
  const std::string trouble = text_at(status, "map.trouble");
  return trouble.empty() ? line : line + "; not saved the last time: " + trouble;
}

std::string clients_line(const json& status) {
  std::vector<std::string> names;
  if (const json* clients = find(status, "pose_socket.clients"); clients != nullptr) {
    for (const json& client : *clients) {
      names.push_back(
          fmt::format("{} ({:.0f})", text_at(client, "name"), number_at(client, "pid")));
    }
  }
  return fmt::format("clients  poses: {}{}; control: {:.0f}; refused {:.0f}, cut off {:.0f}",
                     names.size(),
                     names.empty() ? "" : ": " + fmt::format("{}", fmt::join(names, ", ")),
                     number_at(status, "control_clients"), number_at(status, "pose_socket.refused"),
                     number_at(status, "pose_socket.cut_off"));
}

}  // namespace

double number_at(const json& object, const std::string& path, double otherwise) {
  const json* value = find(object, path);
  return value != nullptr && value->is_number() ? value->get<double>() : otherwise;
}

std::string text_at(const json& object, const std::string& path) {
  const json* value = find(object, path);
  return value != nullptr && value->is_string() ? value->get<std::string>() : std::string{};
}

std::string bytes_in_words(std::uint64_t bytes) {
  constexpr std::array<const char*, 4> kUnits = {"B", "KiB", "MiB", "GiB"};
  constexpr double kStep = 1024;
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= kStep && unit + 1 < kUnits.size()) {
    value /= kStep;
    ++unit;
  }
  return unit == 0 ? fmt::format("{} B", bytes) : fmt::format("{:.1f} {}", value, kUnits.at(unit));
}

std::string daemon_line(const json& status) {
  return fmt::format("geoflowd {}, process {:.0f}, up {}", text_at(status, "version"),
                     number_at(status, "pid"),
                     daemon::in_words(from_seconds(number_at(status, "uptime_s"))));
}

std::vector<std::string> daemon_lines(const json& status) {
  std::vector<std::string> lines = {daemon_line(status)};
  if (const std::string summary = text_at(status, "summary"); !summary.empty()) {
    lines.push_back("state    " + summary);
  }
  lines.insert(lines.end(),
               {source_line(status), frames_line(status), latency_line(status), map_line(status),
                clients_line(status),
                fmt::format("memory   {:.0f} MiB at most", number_at(status, "peak_memory_mib"))});
  return lines;
}

}  // namespace geoflow::tools
