#include "bench/clients_benchmark.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/doorbell.hpp"
#include "geoflow/tools/bench/processes.hpp"
#include "geoflow/tools/bench/scratch_folder.hpp"
#include "geoflow/tools/bench/table.hpp"

#include "bench/client_load.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::literals::operator""_json_pointer;

constexpr Duration kPatience = std::chrono::seconds{5};
constexpr Duration kBetweenLooks = std::chrono::milliseconds{200};
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// What is known of one run.
struct Seen {
  nlohmann::json status;  // the last one; null where there was none
  double rss_mib = kNone;
  std::uint64_t records = 0;
  std::uint64_t garbage = 0;
};

double resident_mib(int process) {
  constexpr double kKibPerMib = 1024;
  std::ifstream file{fmt::format("/proc/{}/status", process)};
  for (std::string word; file >> word;) {
    if (double kib = 0; word == "VmRSS:" && file >> kib) {
      return kib / kKibPerMib;
    }
  }
  return kNone;
}

/// Asks the daemon again and again how it is, until it has gone or the bell is stopped.
void watch(const std::filesystem::path& socket, Seen& seen, timesync::Doorbell& bell) {
  std::optional<daemon::ControlClient> client;
  while (bell.wait(kBetweenLooks) != timesync::Doorbell::Wake::kStopped) {
    if (!client) {
      if (auto connected = daemon::ControlClient::connect(socket)) {
        client.emplace(*std::move(connected));
      }
    }
    if (client) {
      auto reply = client->request({{"cmd", "status"}}, kPatience);
      if (!reply) {
        return;
      }
      seen.status = std::move((*reply)["status"]);
      seen.rss_mib = resident_mib(seen.status.value("pid", 0));
    }
  }
}

Result<Seen> run_once(const ClientsBenchmarkOptions& options, bool with_clients) {
  const ScratchFolder scratch;
  if (scratch.path().empty()) {
    return fail_errno("a temporary folder for the daemon's sockets");
  }
  auto bell = timesync::Doorbell::create();
  if (!bell) {
    return tl::unexpected{std::move(bell.error())};
  }
  const auto pose = scratch.path() / "pose.sock";
  const auto control = scratch.path() / "ctl.sock";
  Command command{
      .arguments = {options.program.string(), "--replay", options.recording.string(), "--realtime",
                    "--pose-socket", pose.string(), "--control-socket", control.string(), "--set",
                    "socket.clients=64", "--set", "socket.clients_per_user=64"},
      .log = scratch.path() / "log"};
  if (!options.calibration.empty()) {
    command.arguments.insert(command.arguments.end(),
                             {"--set", "source.calibration=" + options.calibration.string()});
  }
  Seen seen;
  std::optional<ClientLoad> load;
  if (with_clients) {
    load.emplace(ClientLoadOptions{.socket = pose});
  }
  std::jthread watcher{[&] { watch(control, seen, *bell); }};
  const auto ended = run_processes({&command, 1}, 1, [](std::size_t /*done*/) { return true; });
  bell->stop();
  watcher.join();
  if (!ended) {
    return tl::unexpected{ended.error()};
  }
  if (!ended->front().well() || !seen.status.is_object()) {
    return fail(ErrorCode::kSystem, "{} {}: {}", options.program.string(),
                options.recording.string(), ended->front().how());
  }
  if (load) {
    seen.records = load->records();
    seen.garbage = load->garbage();
  }
  return seen;
}

double number(const Seen& seen, const nlohmann::json::json_pointer& place) {
  return seen.status.value(place, kNone);
}

std::vector<BenchCell> row(int run, const std::string& clients, const Seen& seen,
                           double alone_p99_ms) {
  const auto count = [&](const nlohmann::json::json_pointer& place) {
    return seen.status.value(place, std::int64_t{0});
  };
  const double p99_ms = number(seen, "/times_ms/process/p99"_json_pointer);
  return {std::int64_t{run},
          clients,
          count("/frames"_json_pointer),
          number(seen, "/times_ms/process/p50"_json_pointer),
          p99_ms,
          p99_ms / alone_p99_ms,
          number(seen, "/times_ms/arrival_to_pose/p99"_json_pointer),
          seen.rss_mib,
          static_cast<std::int64_t>(seen.records),
          static_cast<std::int64_t>(seen.garbage),
          count("/pose_socket/refused"_json_pointer),
          count("/pose_socket/cut_off"_json_pointer)};
}

}  // namespace

Result<BenchTable> run_clients_benchmark(const ClientsBenchmarkOptions& options) {
  BenchTable table{.benchmark = "clients",
                   .columns = {"run", "clients", "frames", "process_p50_ms", "process_p99_ms",
                               "p99_ratio", "arrival_to_pose_p99_ms", "rss_mib", "records_read",
                               "garbage_sent", "refused", "cut_off"},
                   .rows = {}};
  for (int run = 1; run <= options.runs; ++run) {
    const auto alone = run_once(options, false);
    const auto with_clients = alone ? run_once(options, true) : alone;
    if (!with_clients) {
      return tl::unexpected{with_clients.error()};
    }
    table.rows.push_back(row(run, "none", *alone, kNone));
    table.rows.push_back(
        row(run, "64", *with_clients, number(*alone, "/times_ms/process/p99"_json_pointer)));
  }
  return table;
}

}  // namespace geoflow::tools
