#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/link_monitor.hpp"
#include "can/snapshot.hpp"

namespace geoflow::drivers::can {

/// Legs on CAN, read by a thread of their own. What goes wrong with the bus is in health(), and the
/// channel is opened again, with growing pauses, until it works; start() fails only if it is
/// started already.
class LegsSource final : public Legs {
 public:
  /// `log` gets every frame as a line of candump -L; a stream that is not open: none.
  LegsSource(LegDictionary dictionary, std::unique_ptr<Channel> channel,
             std::vector<std::string> interfaces, std::ofstream log = {});
  ~LegsSource() override { stop_thread(); }
  LegsSource(const LegsSource&) = delete;
  LegsSource& operator=(const LegsSource&) = delete;

  [[nodiscard]] Result<void> start(LegSink& sink) override;
  void stop() override { stop_thread(); }
  [[nodiscard]] SourceHealth health() const override;
  [[nodiscard]] StampInfo stamps() const override { return assembler_.stamps(); }

 private:
  void stop_thread();
  void run(const std::stop_token& stop, LegSink& sink);
  [[nodiscard]] bool open(Duration& pause);
  void read(LegSink& sink);
  void deliver(LegSink& sink, HostTime now);
  void report(HostTime now);

  const LegDictionary dictionary_;
  std::unique_ptr<Channel> channel_;
  std::vector<std::string> interfaces_;
  SnapshotAssembler assembler_;
  LinkMonitor monitor_;
  std::ofstream log_;
  std::vector<Received> frames_;
  bool open_ = false;
  Listen listening_ = Listen::kToKnown;
  LinkTrouble logged_ = LinkTrouble::kNone;
  mutable std::mutex mutex_;  // guards health_
  SourceHealth health_;
  std::jthread thread_;
};

}  // namespace geoflow::drivers::can
