#include "geoflow/tools/verb.hpp"

#include <array>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/fault.hpp"
#include "geoflow/tools/emulator/faulty_device.hpp"
#include "geoflow/tools/emulator/recorded_world.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"
#include "geoflow/tools/emulator/usbip_server.hpp"
#include "geoflow/tools/interrupt.hpp"

#include "emulate/legs_command.hpp"
#include "emulate/sent_log.hpp"

namespace geoflow::tools {
namespace {

/// USB/IP's own.
constexpr std::uint16_t kDefaultPort = 3240;

constexpr std::string_view kExamples =
    "  geoflow emulate d435i --recording bag --attach        a camera on this machine (as root)\n"
    "  geoflow emulate d435i --recording bag --loop          offered on port 3240; then, as root:\n"
    "      usbip attach -r 127.0.0.1 -b 1-1\n"
    "  geoflow emulate d435i --recording bag --attach --fault stall@5:depth --fault unplug@10+2\n"
    "                                                        with what can go wrong\n"
    "  geoflow emulate d435i --recording bag --attach --clock-start 4290000000\n"
    "                                                        its clock wraps after 5 s\n"
    "  geoflow emulate legs --can vcan0                      a walking robot's legs\n"
    "What the emulated camera is, and faults: docs/emulator.md; legs: docs/legs.md.";

/// Four numbers with dots between them.
Result<emulator::FirmwareVersion> parse_firmware(const std::string& text) {
  std::array<std::uint8_t, 4> parts{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto [next, error] = std::from_chars(at, end, parts[i]);
    const bool last = i + 1 == parts.size();
    if (error != std::errc{} || (last ? next != end : next == end || *next != '.')) {
      return fail(ErrorCode::kInvalidArgument, "--firmware {}: not like 5.12.7.100", text);
    }
    at = last ? next : next + 1;
  }
  return emulator::FirmwareVersion{parts[0], parts[1], parts[2], parts[3]};
}

/// `geoflow emulate DEVICE …`.
class EmulateVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "emulate"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Be a device that any program takes for a real one";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }

  void declare(CLI::App& command) override;
  [[nodiscard]] Result<ExitCode> run(Console& console) override;

 private:
  void declare_d435i(CLI::App& d435i);
  [[nodiscard]] Result<ExitCode> run_d435i(Console& console);
  [[nodiscard]] Result<std::unique_ptr<emulator::D435i>> camera();
  [[nodiscard]] Result<std::vector<emulator::TimedFault>> faults() const;
  [[nodiscard]] Result<ExitCode> serve(emulator::UsbDevice& device, const emulator::D435i& camera,
                                       Console& console) const;
  static void report_shift(Duration shift, Console& console);
  static void report(const emulator::D435iCounters& counters, Console& console);

  CLI::App* legs_command_ = nullptr;
  LegsCommand legs_;
  emulator::RecordedWorldOptions world_;
  emulator::D435iOptions options_;
  std::string calibration_;
  std::string firmware_ = "5.12.7.100";
  std::uint16_t port_ = kDefaultPort;
  bool attach_ = false;
  std::vector<std::string> faults_;
  std::string sent_log_;
};

void EmulateVerb::declare(CLI::App& command) {
  command.require_subcommand(1);
  declare_d435i(*command.add_subcommand("d435i", "An Intel RealSense D435i, by USB/IP"));
  legs_command_ = command.add_subcommand("legs", "A robot's legs, on CAN or DDS");
  legs_command_->fallthrough();
  legs_command_->footer("Examples:\n" + std::string{LegsCommand::examples()});
  legs_.declare(*legs_command_);
}

void EmulateVerb::declare_d435i(CLI::App& d435i) {
  d435i.add_option("--recording", world_.path, "What it sees: a recording")->required();
  d435i.add_option("--calibration", calibration_, "Folder with Kalibr files");
  d435i.add_flag("--loop", world_.loop, "Begin the recording again at its end");
  auto* port = d435i.add_option("--port", port_, "TCP port of 127.0.0.1 to offer it on; 0: any")
                   ->capture_default_str();
  d435i.add_flag("--attach", attach_, "Plug it into this machine's kernel")->excludes(port);
  d435i.add_option("--serial", options_.module_serial, "Serial number, 12 hexadecimal digits")
      ->capture_default_str();
  d435i.add_option("--asic-serial", options_.asic_serial, "USB serial number, the same")
      ->capture_default_str();
  d435i.add_option("--firmware", firmware_, "Version; from 5.16 on the IMU reports 32-bit axes")
      ->capture_default_str();
  d435i.add_option("--clock-start", options_.clock_start_us, "Device clock at power-on [us]")
      ->capture_default_str();
  std::string faults = "FAULT@START[+DURATION][:STREAM] [s], from the first frame on; repeatable:";
  for (const auto& fault : emulator::fault_names()) {
    faults += " ";
    faults += fault.name;
  }
  d435i.add_option("--fault", faults_, faults)->allow_extra_args(false);
  d435i.add_option("--sent-log", sent_log_, "Write down what is sent, for comparison");
  d435i.fallthrough();  // --json is the verb's
  d435i.footer("Examples:\n" + std::string{kExamples});
}

Result<std::unique_ptr<emulator::D435i>> EmulateVerb::camera() {
  auto firmware = parse_firmware(firmware_);
  if (!firmware) {
    return tl::unexpected{std::move(firmware.error())};
  }
  options_.firmware = *firmware;
  if (!calibration_.empty()) {
    world_.calibration = calibration_;
  }
  auto world = emulator::open_recorded_world(world_);
  if (!world) {
    return tl::unexpected{std::move(world.error())};
  }
  return emulator::D435i::create(options_, std::move(*world));
}

Result<std::vector<emulator::TimedFault>> EmulateVerb::faults() const {
  std::vector<emulator::TimedFault> parsed;
  for (const std::string& text : faults_) {
    auto fault = emulator::parse_fault(text);
    if (!fault) {
      return tl::unexpected{std::move(fault.error())};
    }
    parsed.push_back(*fault);
  }
  return parsed;
}

Result<ExitCode> EmulateVerb::run(Console& console) {
  return legs_command_->parsed() ? legs_.run(console) : run_d435i(console);
}

Result<ExitCode> EmulateVerb::run_d435i(Console& console) {
  auto faults = this->faults();
  if (!faults) {
    return tl::unexpected{std::move(faults.error())};
  }
  auto camera = this->camera();
  if (!camera) {
    return tl::unexpected{std::move(camera.error())};
  }
  emulator::FaultyDevice faulty{**camera, std::move(*faults)};
  if (sent_log_.empty()) {
    return serve(faulty, **camera, console);
  }
  auto log = SentLog::open(faulty, sent_log_);
  if (!log) {
    return tl::unexpected{std::move(log.error())};
  }
  return serve(**log, **camera, console);
}

Result<ExitCode> EmulateVerb::serve(emulator::UsbDevice& device, const emulator::D435i& camera,
                                    Console& console) const {
  // A signal that comes between the question and the wait is seen after this.
  constexpr std::chrono::milliseconds kLongestWait{200};
  auto server = attach_ ? emulator::UsbIpServer::attach(device)
                        : emulator::UsbIpServer::listen(device, port_);
  if (!server) {
    return tl::unexpected{std::move(server.error())};
  }
  console.object(
      {{"serial", options_.module_serial}, {"port", (*server)->port()}, {"attached", attach_}});
  if (attach_) {
    console.line("A D435i {} is plugged in", options_.module_serial);
  } else {
    console.line("A D435i {} on 127.0.0.1:{}; plug it in by: usbip attach -r 127.0.0.1 -b {}",
                 options_.module_serial, (*server)->port(), emulator::UsbIpServer::kBusId);
  }
  const InterruptScope interrupt;
  Result<void> served;
  std::optional<Duration> shift;
  while (served && !InterruptScope::requested()) {
    served = (*server)->serve(kLongestWait);
    if (camera.recording_shift() != shift) {
      shift = camera.recording_shift();
      report_shift(*shift, console);
    }
  }
  report(camera.counters(), console);
  return served.map([] { return ExitCode::kInterrupted; });
}

void EmulateVerb::report_shift(Duration shift, Console& console) {
  console.object({{"shift_ns", shift.count()}});
  console.line("It plays; the same robot's legs: --shift {}", shift.count());
}

void EmulateVerb::report(const emulator::D435iCounters& counters, Console& console) {
  console.object({{"frames_sent", counters.frames_sent},
                  {"frames_dropped", counters.frames_dropped},
                  {"reports_sent", counters.reports_sent},
                  {"reports_dropped", counters.reports_dropped},
                  {"samples_rejected", counters.world_errors}});
  console.line("{} frames sent ({} not fetched in time), {} IMU reports ({}); {} samples rejected",
               counters.frames_sent, counters.frames_dropped, counters.reports_sent,
               counters.reports_dropped, counters.world_errors);
}

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_emulate_verb() {
  return std::make_unique<EmulateVerb>();
}

}  // namespace geoflow::tools
