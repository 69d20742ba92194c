#include "geoflow/tools/verb.hpp"

#include <memory>
#include <string>
#include <string_view>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <tl/expected.hpp>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/calibration/imu_noise.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"

#include "calibrate/imu_noise_command.hpp"
#include "calibrate/outcome.hpp"

namespace geoflow::tools {
namespace {

/// A day: longer than anyone records for a noise density.
constexpr double kLongestStillS = 86400;

/// `geoflow calibrate WHAT RECORDING`.
class CalibrateVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "calibrate"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Calibrate a sensor from a recording, with a verdict on each parameter";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow calibrate imu-noise lying-still -o calibration\n"
           "      noise densities of the IMU from a recording in which it lies still; writes\n"
           "      imu-noise.toml, and imu-noise.html with the Allan deviation\n"
           "  geoflow calibrate imu-noise lying-still --json\n"
           "      the findings for scripts; keys in docs/cli.md\n"
           "How to record for each: docs/calibration.md.";
  }

  void declare(CLI::App& command) override {
    command.require_subcommand(1);
    CLI::App* noise =
        add(command, "imu-noise", "Noise of accelerometer and gyroscope, from standing still");
    noise
        ->add_option("--min-still", imu_noise_.min_still_s,
                     "Shortest time of standing still that is accepted [s]")
        ->check(CLI::Range(0.0, kLongestStillS))
        ->capture_default_str();
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return calibrate_imu_noise(recording_, imu_noise_)
        .and_then([&](const Outcome& outcome) -> Result<ExitCode> {
          print(console, outcome);
          const bool failed = calibration::overall(outcome.findings) == calibration::Verdict::kFail;
          return (output_.empty() ? Result<void>{} : write(outcome, output_)).map([&] {
            return failed ? ExitCode::kFailure : ExitCode::kOk;
          });
        });
  }

 private:
  /// One calibration with the options that all have; what is none of its options is the verb's.
  CLI::App* add(CLI::App& command, const std::string& what, const std::string& summary) {
    CLI::App* calibration = command.add_subcommand(what, summary);
    calibration->fallthrough();
    calibration->add_option("RECORDING", recording_, "The recording")->required();
    calibration->add_option("-o,--output", output_,
                            "Folder for the result, a page about it and its figures");
    return calibration;
  }

  std::string recording_;
  std::string output_;
  calibration::ImuNoiseOptions imu_noise_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_calibrate_verb() {
  return std::make_unique<CalibrateVerb>();
}

}  // namespace geoflow::tools
