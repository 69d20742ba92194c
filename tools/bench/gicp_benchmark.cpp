#include "bench/gicp_benchmark.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <pcl/filters/voxel_grid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>
#include <tbb/global_control.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/cpu_time.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"

#include "bench/depth_sequence.hpp"
#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"

namespace geoflow::tools {
namespace {

constexpr double kMillisecondsPerSecond = 1e3;

double cpu_ms() {
  return kMillisecondsPerSecond * thread_cpu_s();
}

/// The value below which the part `p` of the values lie.
double quantile(std::vector<double> values, double p) {
  if (values.empty()) {
    return 0.0;
  }
  const auto rank = static_cast<std::size_t>(p * static_cast<double>(values.size()));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::min(rank, values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) {
    sum += value * value;
  }
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

/// One engine's answer to one pair.
struct Answer {
  SE3 T_target_source;
  Matrix6d information = Matrix6d::Zero();
  double points = 0;
  double preprocess_ms = 0;  ///< of the source
  double register_ms = 0;
  bool converged = false;
};

class Engine {
 public:
  Engine() = default;
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;
  virtual ~Engine() = default;
  [[nodiscard]] virtual const char* name() const = 0;
  [[nodiscard]] virtual Answer align(const FrameRef& source, const FrameRef& target) = 0;
};

class OwnEngine : public Engine {
 public:
  OwnEngine(const std::shared_ptr<const slam::CellGrid>& grid,
            const slam::DepthCloud::Pixels& pixels)
      : source_{grid, pixels, {}}, target_{grid, pixels, {}} {}
  [[nodiscard]] const char* name() const override { return "geoflow"; }
  [[nodiscard]] Answer align(const FrameRef& source, const FrameRef& target) override {
    Answer answer;
    bool built = target_.build(target).has_value();
    const double start = cpu_ms();
    built = source_.build(source).has_value() && built;
    const double middle = cpu_ms();
    const slam::RegistrationResult result = slam::register_clouds(source_, target_, SE3{}, {});
    answer.register_ms = cpu_ms() - middle;
    answer.preprocess_ms = middle - start;
    answer.T_target_source = result.T_target_source;
    answer.information = result.information;
    answer.points = static_cast<double>(source_.size());
    answer.converged = built && result.converged;
    return answer;
  }

 private:
  slam::DepthCloud source_;
  slam::DepthCloud target_;
};

class PclEngine : public Engine {
 public:
  using Cloud = pcl::PointCloud<pcl::PointXYZ>;
  PclEngine(const Calibration& calibration, const GicpBenchmarkOptions& options)
      : calibration_{calibration}, options_{options} {}
  [[nodiscard]] const char* name() const override { return "pcl"; }
  [[nodiscard]] Answer align(const FrameRef& source, const FrameRef& target) override {
    Answer answer;
    const Cloud::Ptr target_cloud = preprocess(target);
    const double start = cpu_ms();
    const Cloud::Ptr source_cloud = preprocess(source);
    const double middle = cpu_ms();
    pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
    gicp.setMaxCorrespondenceDistance(options_.max_distance_m);
    gicp.setCorrespondenceRandomness(options_.neighbours);
    gicp.setInputSource(source_cloud);
    gicp.setInputTarget(target_cloud);
    Cloud aligned;
    gicp.align(aligned);
    answer.register_ms = cpu_ms() - middle;
    answer.preprocess_ms = middle - start;
    const Eigen::Matrix4d T = gicp.getFinalTransformation().cast<double>();
    answer.T_target_source =
        SE3{Matrix3d{T.topLeftCorner<3, 3>()}, Vector3d{T.topRightCorner<3, 1>()}};
    answer.points = static_cast<double>(source_cloud->size());
    answer.converged = gicp.hasConverged();
    return answer;
  }

 private:
  /// All pixels with depth as points, then PCL's voxel grid.
  [[nodiscard]] Cloud::Ptr preprocess(const FrameRef& depth) const {
    const auto all = std::make_shared<Cloud>();
    const CameraIntrinsics& camera = calibration_.camera;
    all->reserve(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    for (int v = 0; v < camera.height; ++v) {
      const auto* const row = depth.row<std::uint16_t>(v);
      for (int u = 0; u < camera.width; ++u) {
        if (row[u] != 0) {
          const double z = row[u] * calibration_.depth_unit_m;
          all->emplace_back(static_cast<float>((u - camera.cx) / camera.fx * z),
                            static_cast<float>((v - camera.cy) / camera.fy * z),
                            static_cast<float>(z));
        }
      }
    }
    const auto thinned = std::make_shared<Cloud>();
    pcl::VoxelGrid<pcl::PointXYZ> grid;
    const auto leaf = static_cast<float>(options_.voxel_m);
    grid.setLeafSize(leaf, leaf, leaf);
    grid.setInputCloud(all);
    grid.filter(*thinned);
    return thinned;
  }

  const Calibration& calibration_;
  const GicpBenchmarkOptions& options_;
};

/// What one engine said over one step.
class Account {
 public:
  void add(const Answer& answer, const SE3& T_reference) {
    const SE3 error = T_reference.inverse() * answer.T_target_source;
    const Vector6d xi = (answer.T_target_source.inverse() * T_reference).log();
    translation_.push_back(error.translation().norm());
    rotation_.push_back(so3::log(error.rotation()).norm());
    preprocess_.push_back(answer.preprocess_ms);
    register_.push_back(answer.register_ms);
    total_.push_back(answer.preprocess_ms + answer.register_ms);
    points_.push_back(answer.points);
    nees_ += xi.dot(answer.information * xi);
    not_converged_ += answer.converged ? 0 : 1;
  }
  [[nodiscard]] GicpBenchmarkRow row(std::string engine, int step) const {
    constexpr double kP95 = 0.95;
    return {.engine = std::move(engine),
            .step = step,
            .pairs = static_cast<int>(total_.size()),
            .points = quantile(points_, 0.5),
            .preprocess_ms = quantile(preprocess_, 0.5),
            .register_ms = quantile(register_, 0.5),
            .total_ms = quantile(total_, 0.5),
            .total_p95_ms = quantile(total_, kP95),
            .translation_median_m = quantile(translation_, 0.5),
            .translation_rms_m = rms(translation_),
            .rotation_median_rad = quantile(rotation_, 0.5),
            .rotation_rms_rad = rms(rotation_),
            .not_converged = not_converged_,
            .nees_mean = nees_ / static_cast<double>(std::max<std::size_t>(total_.size(), 1))};
  }

 private:
  std::vector<double> translation_, rotation_, preprocess_, register_, total_, points_;
  double nees_ = 0;
  int not_converged_ = 0;
};

}  // namespace

Result<std::vector<GicpBenchmarkRow>> run_gicp_benchmark(const GicpBenchmarkOptions& options) {
  if (options.pairs < 1 || options.steps.empty() ||
      std::ranges::any_of(options.steps, [](int s) { return s < 1; })) {
    return fail(ErrorCode::kInvalidArgument,
                "gicp benchmark: at least one pair and steps of at least 1 are needed");
  }
  const int longest = *std::ranges::max_element(options.steps);
  const std::size_t needed =
      static_cast<std::size_t>(options.pairs) + static_cast<std::size_t>(longest);
  const auto sequence = read_depth_sequence(options.recording, options.reference, needed);
  if (!sequence) {
    return tl::unexpected{sequence.error()};
  }
  const auto frames = static_cast<int>(sequence->depth.size());
  if (frames <= longest) {
    return fail(ErrorCode::kInvalidData,
                "{}: {} depth frames with a reference pose, at least {} are needed",
                options.recording.string(), frames, longest + 1);
  }
  const auto grid =
      slam::CellGrid::create(sequence->calibration.camera, slam::DepthCloudConfig{}.cell_px);
  if (!grid) {
    return tl::unexpected{grid.error()};
  }
  const tbb::global_control one_thread{tbb::global_control::max_allowed_parallelism, 1};
  OwnEngine own{*grid,
                {.unit_m = sequence->calibration.depth_unit_m,
                 .alignment = sequence->calibration.depth_alignment}};
  PclEngine pcl{sequence->calibration, options};
  std::vector<GicpBenchmarkRow> rows;
  for (const int step : options.steps) {
    Account own_account;
    Account pcl_account;
    for (int i = 0; i < std::min(options.pairs, frames - step); ++i) {
      const auto a = static_cast<std::size_t>(i);
      const std::size_t b = a + static_cast<std::size_t>(step);
      const SE3 T_reference = sequence->T_world_cam[a].inverse() * sequence->T_world_cam[b];
      own_account.add(own.align(sequence->depth[b], sequence->depth[a]), T_reference);
      pcl_account.add(pcl.align(sequence->depth[b], sequence->depth[a]), T_reference);
    }
    rows.push_back(own_account.row(own.name(), step));
    rows.push_back(pcl_account.row(pcl.name(), step));
  }
  return rows;
}

}  // namespace geoflow::tools
