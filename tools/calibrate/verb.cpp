#include "geoflow/tools/verb.hpp"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <tl/expected.hpp>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/calibration/imu_intrinsics.hpp"
#include "geoflow/calibration/imu_noise.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"

#include "calibrate/imu_command.hpp"
#include "calibrate/imu_noise_command.hpp"
#include "calibrate/outcome.hpp"

namespace geoflow::tools {
namespace {

/// A day: longer than anyone records for a noise density.
constexpr double kLongestStillS = 86400;
/// Of any place on Earth, with room [m/s^2].
constexpr double kLeastGravity = 9.75;
constexpr double kMostGravity = 9.85;

constexpr std::string_view kExamples =
    "  geoflow calibrate imu-noise lying-still -o calibration\n"
    "      noise densities of the IMU from a recording in which it lies still; writes\n"
    "      imu-noise.toml, and imu-noise.html with the Allan deviation\n"
    "  geoflow calibrate imu-noise lying-still --json\n"
    "      the findings for scripts; keys in docs/cli.md\n"
    "  geoflow calibrate imu laid-down --gravity 9.812 -o calibration\n"
    "      scale, misalignment and biases from a recording in which it is laid down on all\n"
    "      its sides, edges and corners in turn, where gravity is 9.812 m/s^2\n"
    "How to record for each: docs/calibration.md.";

/// `geoflow calibrate WHAT RECORDING`.
class CalibrateVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "calibrate"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Calibrate a sensor from a recording, with a verdict on each parameter";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }

  void declare(CLI::App& command) override {
    command.require_subcommand(1);
    CLI::App& noise =
        add(command, "imu-noise", "Noise of accelerometer and gyroscope, from standing still",
            [this] { return calibrate_imu_noise(recording_, imu_noise_); });
    add_min_still(noise, imu_noise_.min_still_s,
                  "Shortest time of standing still that is accepted [s]");
    CLI::App& imu =
        add(command, "imu", "Scale, misalignment and biases, from lying still in many orientations",
            [this] { return calibrate_imu(recording_, imu_); });
    add_min_still(imu, imu_.min_still_s, "Shortest rest that counts as a pose [s]");
    imu.add_option("--gravity", imu_.gravity_mps2, "Gravity where it was recorded [m/s^2]")
        ->check(CLI::Range(kLeastGravity, kMostGravity))
        ->capture_default_str();
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return calibrate_().and_then([&](const Outcome& outcome) -> Result<ExitCode> {
      print(console, outcome);
      const bool failed = calibration::overall(outcome.findings) == calibration::Verdict::kFail;
      return (output_.empty() ? Result<void>{} : write(outcome, output_)).map([&] {
        return failed ? ExitCode::kFailure : ExitCode::kOk;
      });
    });
  }

 private:
  using Calibrate = std::function<Result<Outcome>()>;

  /// One calibration with the options that all have; what is none of its options is the verb's.
  CLI::App& add(CLI::App& command, const std::string& what, const std::string& summary,
                Calibrate calibrate) {
    CLI::App* calibration = command.add_subcommand(what, summary);
    calibration->fallthrough();
    calibration->add_option("RECORDING", recording_, "The recording")->required();
    calibration->add_option("-o,--output", output_,
                            "Folder for the result, a page about it and its figures");
    calibration->callback([this, calibrate = std::move(calibrate)] { calibrate_ = calibrate; });
    return *calibration;
  }

  static void add_min_still(CLI::App& calibration, double& value, const std::string& meaning) {
    calibration.add_option("--min-still", value, meaning)
        ->check(CLI::Range(0.0, kLongestStillS))
        ->capture_default_str();
  }

  Calibrate calibrate_;  // the one that was asked for
  std::string recording_;
  std::string output_;
  calibration::ImuIntrinsicsOptions imu_;
  calibration::ImuNoiseOptions imu_noise_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_calibrate_verb() {
  return std::make_unique<CalibrateVerb>();
}

}  // namespace geoflow::tools
