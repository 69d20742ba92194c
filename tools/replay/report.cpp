#include "replay/report.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/daemon/version.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"

#include "replay/session.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

double to_milliseconds(Duration duration) {
  constexpr double kMillisecondsPerSecond = 1e3;
  return to_seconds(duration) * kMillisecondsPerSecond;
}

json describe_input(const drivers::RecordingInfo& info, const daemon::Config& config) {
  json streams = json::array();
  for (const auto& stream : info.streams) {
    streams.push_back({{"name", stream.name}, {"type", stream.type}, {"count", stream.count}});
  }
  return {{"path", config.source.replay.string()},
          {"format", info.format},
          {"start_ns", info.start.time_since_epoch().count()},
          {"end_ns", info.end.time_since_epoch().count()},
          {"streams", std::move(streams)}};
}

json describe_faults(const drivers::FaultCounters& faults) {
  json kinds = json::object();
  for (std::size_t k = 0; k < drivers::kFaultKindCount; ++k) {
    for (std::size_t s = 0; s < drivers::kStreamCount; ++s) {
      const auto kind = static_cast<drivers::FaultKind>(k);
      const auto stream = static_cast<drivers::StreamId>(s);
      if (const std::uint64_t count = faults.of(kind, stream); count > 0) {
        kinds[std::string{name(kind)}][std::string{name(stream)}] = count;
      }
    }
  }
  return kinds;
}

json describe_speed(const ReplayResult& result) {
  const drivers::DecodeStatistics decode = result.run.streams->decode_statistics();
  const auto frames = static_cast<double>(result.run.statistics->frames());
  const double elapsed_s = to_seconds(result.elapsed);
  const double working_s = to_seconds(result.elapsed - decode.waited);
  const double mean_ms =
      decode.images > 0 ? to_milliseconds(decode.total) / static_cast<double>(decode.images) : 0.0;
  return {{"elapsed_s", elapsed_s},
          {"first_pose_s", to_seconds(result.first_pose)},
          {"frames_per_s", elapsed_s > 0 ? frames / elapsed_s : 0.0},
          {"frames_per_s_without_decoding", working_s > 0 ? frames / working_s : 0.0},
          {"decoding",
           {{"images", decode.images},
            {"mean_ms", mean_ms},
            {"max_ms", to_milliseconds(decode.longest)},
            {"waited_s", to_seconds(decode.waited)}}}};
}

json describe_configuration(const daemon::Config& config) {
  json values = json::object();
  for (const auto& [key, value] : daemon::list_keys(config)) {
    values[key] = value;
  }
  return values;
}

}  // namespace

json make_report(const ReplayResult& result, const daemon::Config& config) {
  const drivers::RecordedStreams& streams = *result.run.streams;
  const Calibration& calibration = streams.calibration();
  json report = daemon::to_json(*result.run.statistics);
  report["time_histograms_ms"] = daemon::histograms_to_json(*result.run.statistics);
  report["version"] = std::string{daemon::version()};
  report["input"] = describe_input(streams.info(), config);
  report["calibration"] = {{"source", calibration.source},
                           {"serial", calibration.serial},
                           {"has_imu_extrinsic", calibration.T_cam_imu.has_value()},
                           {"has_base_extrinsic", calibration.T_base_cam.has_value()}};
  report["faults"] = describe_faults(streams.faults());
  report["rejected"] = {{"count", result.run.statistics->counters.rejected.load()},
                        {"messages", streams.recent_errors()}};
  const slam::Core::Readout readout = result.run.core->readout();
  report["camera_readout"] = {{"mean_s", readout.mean_s}, {"sigma_s", readout.sigma_s}};
  report["synchroniser"] = daemon::to_json(result.run.synchroniser);
  report["speed"] = describe_speed(result);
  report["peak_memory_mib"] = daemon::peak_memory_mib();
  report["interrupted"] = result.interrupted;
  report["configuration"] = describe_configuration(config);
  return report;
}

}  // namespace geoflow::tools
