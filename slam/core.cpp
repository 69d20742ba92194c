#include "geoflow/slam/core.hpp"

#include <memory>
#include <optional>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/slam/mapping.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/slam/stage.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "core_impl.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "map/map_correction.hpp"
#include "map/mapping_problem.hpp"
#include "optimisation/pose_graph.hpp"
#include "place/loop_closer.hpp"
#include "storage/stored_map.hpp"

namespace geoflow::slam {

std::optional<MappingTask> Core::Impl::take_mapping_task() {
  extend_map();
  if (std::exchange(loop_found_, false)) {
    return MappingTask{.problem = nullptr,
                       .graph = std::make_shared<const PoseGraphProblem>(pose_graph(map_)),
                       .revision = revision_};
  }
  if (!pending_) {
    return std::nullopt;
  }
  const KeyframeId newest = *pending_;
  pending_.reset();
  MappingTask task = map_.begins_thread(newest) ? MappingTask{} : builder_.task(map_, newest);
  if (config_.switches.loop_closing) {
    task.loops = loop_closer_.problem(map_, newest);
  }
  task.revision = revision_;
  return task;
}

std::optional<MappingTask> Core::Impl::take_global_task() {
  extend_map();
  if (!std::exchange(global_due_, false)) {
    return std::nullopt;
  }
  MappingTask task = builder_.whole_map_task(map_);
  task.revision = revision_;
  return task;
}

void Core::Impl::apply(const MappingResult& result) {
  const bool current = result.revision == revision_;
  if (result.solution) {
    take_over(*result.solution, current);
  }
  if (result.loops) {
    for (const RelativeEdge& loop : loop_closer_.consider(map_, *result.loops)) {
      if (map_.same_part(loop.from, loop.to)) {
        loop_found_ = loop_found_ || moves_map(map_, loop);
        map_.add_edge(loop);
      } else {
        join(loop);
      }
    }
  }
  if (result.graph && !current) {
    loop_found_ = true;
  } else if (result.graph) {
    if (const std::optional<SE3> T_map1_map0 = correct(map_, *result.graph)) {
      move_in_map(*T_map1_map0);
      global_due_ = true;
    }
  }
}

void Core::Impl::take_over(const MappingSolution& solution, bool current) {
  if (!current) {
    global_due_ = global_due_ || solution.whole_map;
    for (const RelativeEdge& edge : solution.measured) {
      map_.add_edge(edge);
    }
  } else if (solution.whole_map) {
    move_in_map(builder_.apply(map_, solution));
  } else {
    move(builder_.apply(map_, solution));
  }
  if (current && !solution.gyro_bias.empty()) {
    reckoner_.see_gyro_bias(solution.gyro_bias.rbegin()->second);
  }
}

void Core::Impl::join(const RelativeEdge& tie) {
  const bool here = map_.keyframe(tie.to).part == map_.newest_part();
  const SE3 T_map1_map0 = map_.join(tie);
  if (here) {
    move_in_map(T_map1_map0);
  }
  global_due_ = true;
}

void Core::Impl::move_in_map(const SE3& T_map1_map0) {
  move(T_map1_map0);
  T_map_odom_ = T_map1_map0 * T_map_odom_;
  ++revision_;
}

void Core::Impl::move(const SE3& T_odom1_odom0) {
  tracker_.current().T_odom_cam = T_odom1_odom0 * tracker_.current().T_odom_cam;
  motion_.move(T_odom1_odom0);
  scale_.move(T_odom1_odom0);
  T_odom_cam_ = T_odom1_odom0 * T_odom_cam_;
}

Core::Core(std::unique_ptr<Impl> impl) : impl_{std::move(impl)} {}
Core::~Core() = default;

Result<std::unique_ptr<Core>> Core::create(const Calibration& calibration, const Config& config,
                                           StageObserver* observer, const StoredMap* saved) {
  auto grid = CellGrid::create(calibration.camera, DepthCloudConfig{}.cell_px);
  if (!grid) {
    return tl::unexpected{std::move(grid).error()};
  }
  return std::make_unique<Core>(
      std::make_unique<Impl>(calibration, config, *std::move(grid), observer, saved));
}

PoseEstimate Core::process(const SyncedPacket& packet) {
  return impl_->process(packet);
}
void Core::extend_map() {
  impl_->extend_map();
}
std::optional<MappingTask> Core::take_mapping_task() {
  return impl_->take_mapping_task();
}
std::optional<MappingTask> Core::take_global_task() {
  return impl_->take_global_task();
}
void Core::apply(const MappingResult& result) {
  impl_->apply(result);
}
std::shared_ptr<const StoredMap> Core::snapshot() const {
  return impl_->snapshot();
}
Core::Readout Core::readout() const {
  return impl_->readout();
}
Trajectory Core::final_trajectory() const {
  return impl_->final_trajectory();
}

}  // namespace geoflow::slam
