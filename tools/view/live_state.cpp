#include "view/live_state.hpp"

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

constexpr double kSpacing_m = 0.02;
constexpr std::size_t kMostPoints = 20'000;
constexpr const char* kWay = "way";

std::string event_text(const std::string& name, const std::string& data) {
  return fmt::format("event: {}\ndata: {}\n\n", name, data);
}

}  // namespace

void LiveState::put(const std::string& event, std::string data) {
  {
    const std::scoped_lock lock{mutex_};
    events_[event] = {.data = std::move(data), .version = ++version_};
  }
  changed_.notify_all();
}

void LiveState::add_to_way(const Vector3d& p_odom_base) {
  const std::scoped_lock lock{mutex_};
  if (!way_.empty() && (way_.back() - p_odom_base).norm() < kSpacing_m) {
    return;
  }
  if (way_.size() >= kMostPoints) {
    for (std::size_t i = 0; 2 * i < way_.size(); ++i) {
      way_[i] = way_[2 * i];
    }
    way_.resize(way_.size() / 2);
  }
  way_.push_back(p_odom_base);
}

void LiveState::clear_way() {
  {
    const std::scoped_lock lock{mutex_};
    way_.clear();
    ++way_version_;
  }
  changed_.notify_all();
}

std::string LiveState::way() const {
  std::string points;
  for (const Vector3d& p : way_) {
    points +=
        fmt::format("{}[{:.3f},{:.3f},{:.3f}]", points.empty() ? "" : ",", p.x(), p.y(), p.z());
  }
  return "[" + points + "]";
}

std::string LiveState::news(PageProgress& page) const {
  std::string text;
  if (std::uint64_t& told = page.told[kWay]; told != way_version_) {
    told = way_version_;
    text += event_text(kWay, way());
  }
  for (const auto& [name, event] : events_) {
    if (std::uint64_t& told = page.told[name]; told != event.version) {
      told = event.version;
      text += event_text(name, event.data);
    }
  }
  return text;
}

std::string LiveState::next(PageProgress& page, Duration timeout) {
  std::unique_lock lock{mutex_};
  std::string text;
  changed_.wait_for(lock, timeout, [&] {
    text = closed_ ? std::string{} : news(page);
    return closed_ || !text.empty();
  });
  return closed_ || !text.empty() ? text : ": nothing new\n\n";
}

void LiveState::close() {
  {
    const std::scoped_lock lock{mutex_};
    closed_ = true;
  }
  changed_.notify_all();
}

}  // namespace geoflow::tools
