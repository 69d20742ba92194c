#pragma once

#include <cstddef>
#include <cstdint>

namespace geoflow::slam {

/// The parts of the work on one frame, for timing.
enum class Stage : std::uint8_t {
  kPyramid,
  kFlow,
  kCloud,
  kPoseInitialisation,
  kPoseOptimisation,
  kFeatures,
  kKeyframe,
  kMapping,
  kGlobalMapping,
};
inline constexpr std::size_t kStageCount = 9;

[[nodiscard]] const char* to_string(Stage stage) noexcept;

/// Told when a stage begins and ends, in the thread that works on it. Different stages overlap, in
/// different threads; no stage overlaps itself. slam has no clock: who wants times measures them
/// here.
class StageObserver {
 public:
  StageObserver() = default;
  StageObserver(const StageObserver&) = delete;
  StageObserver& operator=(const StageObserver&) = delete;
  virtual ~StageObserver() = default;
  virtual void begin(Stage stage) = 0;
  virtual void end(Stage stage) = 0;
};

/// Tells an observer, if there is one, for the length of a scope.
class StageScope {
 public:
  StageScope(StageObserver* observer, Stage stage) : observer_{observer}, stage_{stage} {
    if (observer_ != nullptr) {
      observer_->begin(stage_);
    }
  }
  StageScope(const StageScope&) = delete;
  StageScope& operator=(const StageScope&) = delete;
  ~StageScope() {
    if (observer_ != nullptr) {
      observer_->end(stage_);
    }
  }

 private:
  StageObserver* observer_;
  Stage stage_;
};

}  // namespace geoflow::slam
