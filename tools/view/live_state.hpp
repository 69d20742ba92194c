#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {

/// What has been told to one page, so that it is told what is newer.
struct PageProgress {
  std::map<std::string, std::uint64_t> told;  ///< by the event's name, the version that it has
};

/// What pages are shown: of each kind of event the newest, and the way so far. One thread puts
/// events, any number wait for them; a page that is slow misses what others have replaced by then,
/// and holds up nobody. Thread-safe.
class LiveState {
 public:
  /// Replaces the newest event of this name. `data` has no line breaks.
  void put(const std::string& event, std::string data);
  /// Adds to the way, in odom, that a page which comes later is given first. Points nearer than 2
  /// cm to the last one are left out, and of 20000 every second one when they are full.
  void add_to_way(const Vector3d& p_odom_base);
  /// The way begins anew, on all pages: another daemon, or odom began anew.
  void clear_way();

  /// What a page has not been told, as server-sent events (WHATWG HTML, 9.2); waits for it at most
  /// `timeout`, and is a comment then, so that the connection is seen to live. Empty once closed.
  [[nodiscard]] std::string next(PageProgress& page, Duration timeout);

  /// Ends all waiting, for good.
  void close();

 private:
  struct Event {
    std::string data;
    std::uint64_t version = 0;
  };
  [[nodiscard]] std::string news(PageProgress& page) const;
  [[nodiscard]] std::string way() const;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Event> events_;
  std::vector<Vector3d> way_;
  std::uint64_t way_version_ = 1;
  std::uint64_t version_ = 0;
  bool closed_ = false;
};

}  // namespace geoflow::tools
