#include "config/reload.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <variant>
#include <vector>

#include "geoflow/daemon/config.hpp"

#include "config/keys.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::array<std::string_view, 6> kAtRunTime = {"source.loop",
                                                        "socket.clients",
                                                        "socket.clients_per_user",
                                                        "socket.handshake_timeout_s",
                                                        "socket.stall_timeout_s",
                                                        "map.save_interval_s"};

// Both are of keys of the same name, and so of the same type.

bool equal(const Key& a, const Key& b) {
  return std::visit(
      [&]<typename Value>(const Value* value) { return *value == *std::get<Value*>(b.target); },
      a.target);
}

void assign(const Key& from, const Key& to) {
  std::visit([&]<typename Value>(Value* value) { *value = *std::get<Value*>(from.target); },
             to.target);
}

}  // namespace

Reload take_over(const Config& read, const Config& started, Config& running) {
  Config read_copy = read;
  Config started_copy = started;
  const std::vector<Key> news = bind_keys(read_copy);
  const std::vector<Key> olds = bind_keys(started_copy);
  const std::vector<Key> held = bind_keys(running);
  Reload reload;
  for (std::size_t i = 0; i < news.size(); ++i) {
    if (std::ranges::find(kAtRunTime, news[i].name) == kAtRunTime.end()) {
      if (!equal(news[i], olds[i])) {
        reload.restart.push_back(news[i].name);
      }
    } else if (!equal(news[i], held[i])) {
      assign(news[i], held[i]);
      reload.changed.push_back(news[i].name);
    }
  }
  return reload;
}

}  // namespace geoflow::daemon
