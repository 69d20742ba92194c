#include "simulate/writer.hpp"

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/simulation.hpp"
#include "geoflow/tools/simulator/truth_files.hpp"
#include "geoflow/tools/simulator/tum_writer.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;
using simulator::BodyState;
using simulator::Simulation;

constexpr const char* kParameters = "simulation.json";
constexpr const char* kTruthTopic = "/ground_truth/odometry";

/// A folder beside the recording's place, gone at the end of scope unless it was moved there.
class PartialFolder {
 public:
  explicit PartialFolder(const fs::path& target)
      : target_{target},
        outer_{target.parent_path() / fmt::format(".{}.partial", target.filename().string())} {
    std::error_code ignored;
    fs::remove_all(outer_, ignored);
  }
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;
  ~PartialFolder() {
    std::error_code ignored;
    fs::remove_all(outer_, ignored);
  }

  /// Has the recording's own name, because files in it bear that.
  [[nodiscard]] fs::path path() const { return outer_ / target_.filename(); }

  [[nodiscard]] Result<void> make() const {
    std::error_code error;
    fs::create_directories(outer_, error);
    return error ? fail(ErrorCode::kSystem, "{}: {}", outer_.string(), error.message())
                 : Result<void>{};
  }

  [[nodiscard]] Result<void> move() const {
    std::error_code error;
    fs::rename(path(), target_, error);
    return error ? fail(ErrorCode::kSystem, "{}: {}", target_.string(), error.message())
                 : Result<void>{};
  }

 private:
  fs::path target_;
  fs::path outer_;
};

/// Gives each image and inertial sample to the bag and, where there is one, to the TUM folder.
class Fork final : public CameraSink, public ImuSink {
 public:
  Fork(drivers::BagWriter& bag, simulator::TumWriter* tum) : bag_{bag}, tum_{tum} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    bag_.on_color(frame);
    if (tum_ != nullptr) {
      tum_->on_color(frame);
    }
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    bag_.on_depth(frame);
    if (tum_ != nullptr) {
      tum_->on_depth(frame);
    }
  }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
    bag_.on_imu(sample);
    if (tum_ != nullptr) {
      tum_->on_imu(sample);
    }
  }

 private:
  drivers::BagWriter& bag_;
  simulator::TumWriter* tum_;
};

drivers::OdometrySample odometry_of(const BodyState& body) {
  return {.T_parent_child = body.T_world_base,
          .v_child_mps = body.T_world_base.rotation().conjugate() * body.v_world_base,
          .w_child_radps = body.w_base};
}

Result<void> write_parameters(const fs::path& directory, const nlohmann::json& parameters) {
  constexpr int kIndent = 2;
  std::ofstream file{directory / kParameters, std::ios::binary | std::ios::trunc};
  file << parameters.dump(kIndent) << "\n";
  file.close();
  return file ? Result<void>{}
              : fail(ErrorCode::kSystem, "{}: cannot be written",
                     (directory / kParameters).string());
}

}  // namespace

Result<bool> write_simulation(Simulation& simulation, const WriteOptions& options,
                              const std::function<bool(std::size_t, std::size_t)>& progress) {
  const fs::path target = fs::absolute(options.directory).lexically_normal();
  const fs::path named = target.has_filename() ? target : target.parent_path();
  std::error_code error;
  if (fs::exists(named, error)) {
    return fail(ErrorCode::kInvalidArgument, "{}: exists", named.string());
  }
  const PartialFolder partial{named};
  if (auto made = partial.make(); !made) {
    return tl::unexpected{std::move(made.error())};
  }
  drivers::BagWriterOptions bag_options{.directory = partial.path()};
  bag_options.compress = options.compress;
  bag_options.camera_stamps = bag_options.imu_stamps = bag_options.leg_stamps = simulation.stamps();
  auto bag = drivers::BagWriter::create(bag_options, simulation.calibration());
  if (!bag) {
    return tl::unexpected{std::move(bag.error())};
  }
  std::optional<simulator::TumWriter> tum;
  if (options.tum) {
    tum.emplace(partial.path() / "tum");
    if (auto opened = tum->open(simulation.calibration()); !opened) {
      return tl::unexpected{std::move(opened.error())};
    }
  }
  simulator::TruthFiles truth{partial.path()};
  Fork fork{**bag, tum ? &*tum : nullptr};
  const std::size_t total = simulation.frames();
  auto finished = simulation.run(
      {.camera = fork,
       .imu = fork,
       .legs = **bag,
       .truth =
           [&](const simulator::TruthSample& sample) {
             truth.add(sample);
             (*bag)->write_odometry(kTruthTopic, sample.t, odometry_of(sample.body));
           },
       .frame_truth = [&](const simulator::FrameTruth& frame) { truth.add(frame); }},
      [&](std::size_t done) { return progress(done, total) && (*bag)->status().has_value(); });
  auto closed = (*bag)->close();
  for (const auto& close :
       {std::function<Result<void>()>{[&] { return truth.close(); }},
        {[&] { return tum ? tum->close() : Result<void>{}; }},
        {[&] { return write_parameters(partial.path(), options.parameters); }}}) {
    closed = closed ? close() : closed;
  }
  if (!closed) {
    return tl::unexpected{std::move(closed.error())};
  }
  if (!finished || !*finished) {
    return finished;
  }
  if (tum) {
    fs::copy_file(partial.path() / "groundtruth.txt", partial.path() / "tum" / "groundtruth.txt",
                  error);
  }
  return partial.move().map([] { return true; });
}

bool is_same_simulation(const fs::path& directory, const nlohmann::json& parameters) {
  std::ifstream file{directory / kParameters};
  return file && nlohmann::json::parse(file, nullptr, false) == parameters;
}

Result<void> remove_simulation(const fs::path& directory) {
  std::error_code error;
  if (!fs::exists(directory / kParameters, error)) {
    return fail(ErrorCode::kInvalidArgument,
                "{}: exists, and is not a simulation that could be replaced", directory.string());
  }
  fs::remove_all(directory, error);
  return error ? fail(ErrorCode::kSystem, "{}: {}", directory.string(), error.message())
               : Result<void>{};
}

}  // namespace geoflow::tools
