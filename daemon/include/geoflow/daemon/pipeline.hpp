#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/thread_activity.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// What is called with what comes out.
struct PipelineHandlers {
  EstimateHandler on_estimate;   ///< on slam
  std::function<void()> on_end;  ///< on slam, once, when the source has ended and its last packet
                                 ///< is done; not after stop()
  PropagatedHandler on_propagated{};  ///< on sync; empty: nothing is propagated
  BetweenFrames between_frames{};     ///< on slam, before each frame and after wake()
};

/// The live pipeline, on threads of its own:
///
///     replay  the source; its sinks push to bounded queues and never block
///     sync    synchroniser: samples -> packets; carries the newest estimate on to each IMU sample
///     slam    Core::process; takes over what mapping found between two packets
///     map     local bundle adjustment, one task at a time
///
/// They share lock-free queues, doorbells and relaxed counters, nothing else. Images and packets
/// that come while their queue is full displace the oldest there, and are counted. While one
/// mapping task is worked on no other is taken: a keyframe made meanwhile waits for the next.
class Pipeline {
 public:
  /// Starts all threads. `run` must outlive the pipeline and is its own while it runs; only
  /// run.statistics may be read meanwhile.
  [[nodiscard]] static Result<std::unique_ptr<Pipeline>> start(Run& run, const Config& config,
                                                               PipelineHandlers handlers);
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;
  ~Pipeline();

  /// Ends all threads, after the packet that is worked on, and joins them; then run.synchroniser is
  /// filled. Not from one of its own threads. Idempotent.
  void stop();

  /// Has handlers.between_frames called soon, whether frames come or not. Any thread.
  void wake() noexcept;

  /// What its threads show of themselves. Any thread, until stop().
  [[nodiscard]] std::vector<ThreadActivity> threads() const;

 private:
  class Implementation;
  explicit Pipeline(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace geoflow::daemon
