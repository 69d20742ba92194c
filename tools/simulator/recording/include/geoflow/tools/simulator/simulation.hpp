#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/leg_simulator.hpp"
#include "geoflow/tools/simulator/recording_options.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/walk.hpp"

namespace geoflow::simulator {

/// Everything that decides what is recorded. Two equal ones give the same samples, bit for bit.
struct SimulationOptions {
  std::string scene = "office";  ///< one of scenes()
  std::uint64_t seed = 1;        ///< of scene, walk and all sensors
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double duration_s = 60;
  WalkOptions walk{};  ///< seed and duration are those above
  ImuOptions imu{};
  LegSensorOptions legs{};
  SceneOptions place{};
  CameraOptions camera{};  ///< seed is the one above
  RecordingOptions recording{};
};

/// What is true at one sample of the IMU.
struct TruthSample {
  HostTime t;
  BodyState body;
  ImuReading imu;  ///< with the true biases
  LegTruth legs;
};

/// What is true of one colour image, at the middle of its exposure.
struct FrameTruth {
  HostTime t;
  SE3 T_world_base;
  SE3 T_world_cam;
};

/// Where the samples go. All members are called on the thread that runs the simulation.
struct SimulationSinks {
  CameraSink& camera;
  ImuSink& imu;
  LegSink& legs;
  std::function<void(const TruthSample&)> truth;
  std::function<void(const FrameTruth&)> frame_truth;
};

/// CPU time of the thread that runs the simulation [s]: all of it where the TBB arena has one
/// thread.
struct SimulationCost {
  RenderCost render{};
  double delivery_s = 0;  ///< the sinks', and samples other than images
};

/// A robot that walks through a scene, as the samples that its sensors would deliver. Thread-bound;
/// rendering uses the TBB arena that run() is called in.
class Simulation {
 public:
  /// The instant 0 of the simulation on the recording's time line.
  static constexpr HostTime kStart{std::chrono::seconds{1000}};

  /// Makes scene, walk and sensors. Errors name what cannot be: a scene or walk that the options do
  /// not allow, or the ray tracer.
  [[nodiscard]] static Result<std::unique_ptr<Simulation>> create(const SimulationOptions& options);
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;
  ~Simulation();

  /// The sensors' true calibration; noise densities as simulated.
  [[nodiscard]] const Calibration& calibration() const noexcept;
  /// How images and inertial samples, and those of the legs, are stamped.
  [[nodiscard]] StampInfo stamps() const noexcept;
  /// Pairs of images that run() delivers.
  [[nodiscard]] std::size_t frames() const noexcept;
  /// What run() has taken so far.
  [[nodiscard]] const SimulationCost& cost() const noexcept;

  /// Delivers everything in order of arrival, once. `go_on` gets the number of rendered frames
  /// after each; false ends the run early. True when it came to its end.
  [[nodiscard]] Result<bool> run(const SimulationSinks& sinks,
                                 const std::function<bool(std::size_t frames)>& go_on);

 private:
  class Implementation;
  explicit Simulation(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace geoflow::simulator
