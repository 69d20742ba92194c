#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "map/map_cloud.hpp"
#include "map/map_job.hpp"
#include "map/map_keeper.hpp"
#include "server/control_connection.hpp"

namespace geoflow::daemon {

/// What is asked of the map, by clients and by the clock: one job after another, and an answer for
/// whoever asked. Whoever asks for a job that has not begun yet shares it with those who asked
/// before. Thread-bound: the loop's.
class MapCommands {
 public:
  using Answer = std::function<void(const Asker&, const Result<nlohmann::json>&)>;
  using Show = std::function<void(const MapCloud&)>;
  /// `show` gets the map's surfaces while they are wanted.
  MapCommands(Answer answer, Show show) : answer_{std::move(answer)}, show_{std::move(show)} {}

  /// Has a job done for a client; it is answered when that is done, or cannot be.
  void ask(const MapOrder& order, const Asker& asker, HostTime now);
  /// Goes on: takes what is done, begins what is due. `keeper` is null while there is no run; what
  /// is asked then waits for one for two seconds.
  /// `interval`: how often the map is saved; zero: not by the clock. To be called when the keeper
  /// rings, and a few times a second.
  void turn(MapKeeper* keeper, Duration interval, HostTime now);
  /// Whether anybody wants to see the map: then it is shown soon, and again when it has changed,
  /// every few seconds at most.
  void want_to_see(bool wanted) noexcept { wanted_ = wanted; }
  /// The run has ended: what was asked of it is for the next one.
  void hold();
  /// What was asked will not be done.
  void abandon(const std::string& why);

  /// Why the map was not saved the last time that it was to be; empty where it was.
  [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
  /// For the status reply: `saved_s` ago, `keyframes`, `bytes` (null before the first time), and
  /// `trouble`: why it was not saved the last time.
  [[nodiscard]] nlohmann::json status(HostTime now) const;

 private:
  struct Request {
    MapOrder order;
    HostTime since;  // it was asked for
    std::vector<Asker> askers;
  };
  void conclude(const MapOutcome& outcome, HostTime now);
  void begin(MapKeeper& keeper, Request request, HostTime now);
  [[nodiscard]] std::optional<MapJob> due(const MapKeeper& keeper, Duration interval, HostTime now);
  void answer(const Result<MapReport>& report);
  void note(MapJob job, const Error& error);

  Answer answer_;
  Show show_;
  bool wanted_ = false;
  std::optional<HostTime> tried_to_show_at_;
  std::optional<MapMark> shown_;  // none: not as it is
  std::deque<Request> queue_;
  std::optional<Request> under_way_;
  std::optional<HostTime> tried_at_;  // the last time that it was to be saved
  std::optional<HostTime> saved_at_;
  MapReport saved_;
  std::string trouble_;
};

}  // namespace geoflow::daemon
