#include "top/table.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/tools/daemon_text.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

/// For each key of `now`, how much the number at `path` in it has grown a second.
json growth(const json& before, const json& now, const std::string& path, double seconds) {
  json rates = json::object();
  for (const auto& [name, value] : now.items()) {
    const json earlier = before.value(name, json{});
    const double grown = path.empty() ? (value.is_number() ? value.get<double>() : 0) -
                                            (earlier.is_number() ? earlier.get<double>() : 0)
                                      : number_at(value, path) - number_at(earlier, path);
    rates[name] = seconds > 0 ? std::max(grown, 0.0) / seconds : 0;
  }
  return rates;
}

json section(const json& status, const char* name) {
  const auto found = status.find(name);
  return found != status.end() && found->is_object() ? *found : json::object();
}

void add_sensors(const json& status, const json& rates, std::vector<std::string>& lines) {
  lines.emplace_back("");
  lines.push_back(fmt::format("{:<10} {:<10} {:>8} {:>12} {:>9} {:>9}  {}", "SENSOR", "STATE",
                              "RATE/s", "DELIVERED", "REJECTED", "DROPPED", "REASON"));
  const json sources = section(status, "health");
  for (const auto& [name, health] : sources.items()) {
    lines.push_back(fmt::format("{:<10} {:<10} {:>8.1f} {:>12.0f} {:>9.0f} {:>9.0f}  {}", name,
                                text_at(health, "state"), number_at(rates, "sources." + name),
                                number_at(health, "delivered"), number_at(health, "rejected"),
                                number_at(health, "dropped"), text_at(health, "reason")));
  }
}

void add_stages(const json& status, const json& rates, std::vector<std::string>& lines) {
  lines.emplace_back("");
  lines.push_back(fmt::format("{:<18} {:>8} {:>9} {:>9} {:>9} {:>9}", "STAGE [ms]", "RATE/s",
                              "MEAN", "P50", "P99", "MAX"));
  const json stages = section(status, "times_ms");
  for (const auto& [name, times] : stages.items()) {
    if (number_at(times, "count") > 0) {
      lines.push_back(fmt::format("{:<18} {:>8.1f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f}", name,
                                  number_at(rates, "stages." + name), number_at(times, "mean"),
                                  number_at(times, "p50"), number_at(times, "p99"),
                                  number_at(times, "max")));
    }
  }
}

void add_clients(const json& status, std::vector<std::string>& lines) {
  const json clients = section(status, "pose_socket").value("clients", json::array());
  if (clients.empty()) {
    return;
  }
  lines.emplace_back("");
  lines.push_back(fmt::format("{:<24} {:>8} {:>8} {:>12} {:>9}", "CLIENT", "PROCESS", "USER",
                              "SENT", "DROPPED"));
  for (const json& client : clients) {
    lines.push_back(fmt::format("{:<24} {:>8.0f} {:>8.0f} {:>12.0f} {:>9.0f}",
                                text_at(client, "name"), number_at(client, "pid"),
                                number_at(client, "uid"), number_at(client, "sent"),
                                number_at(client, "dropped")));
  }
}

}  // namespace

json rates(const json& before, const json& now) {
  const bool same = number_at(before, "pid") == number_at(now, "pid");
  const double seconds = same ? number_at(now, "uptime_s") - number_at(before, "uptime_s") : 0;
  const double frames = number_at(now, "frames") - number_at(before, "frames");
  return {
      {"frames_hz", seconds > 0 ? std::max(frames, 0.0) / seconds : 0},
      {"sources", growth(section(before, "health"), section(now, "health"), "delivered", seconds)},
      {"stages", growth(section(before, "times_ms"), section(now, "times_ms"), "count", seconds)},
      {"drops", growth(section(before, "drops"), section(now, "drops"), "", seconds)}};
}

std::vector<std::string> top_lines(const json& status, const json& rates) {
  std::vector<std::string> lines = {daemon_line(status), text_at(status, "summary")};
  lines.push_back(
      fmt::format("frames {:.1f}/s; dropped/s: colour {:.1f}, depth {:.1f}, samples {:.1f}, "
                  "packets {:.1f}; memory {:.0f} MiB at most",
                  number_at(rates, "frames_hz"), number_at(rates, "drops.color"),
                  number_at(rates, "drops.depth"), number_at(rates, "drops.samples"),
                  number_at(rates, "drops.packets"), number_at(status, "peak_memory_mib")));
  add_sensors(status, rates, lines);
  add_stages(status, rates, lines);
  add_clients(status, lines);
  return lines;
}

}  // namespace geoflow::tools
