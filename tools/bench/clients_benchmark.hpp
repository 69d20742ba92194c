#pragma once

#include <filesystem>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {

struct ClientsBenchmarkOptions {
  std::filesystem::path program;  ///< `geoflowd`
  std::filesystem::path recording;
  std::filesystem::path calibration{};  ///< folder; empty: found in the recording
  int runs = 3;
};

/// Runs the daemon on the recording at its pace, in turns alone and with 64 clients of which 16
/// never read and 8 send garbage as fast as they can (client_load.hpp): two rows for each run. The
/// second one's `p99_ratio` is its `process_p99_ms` over that of the first. Blocks. Errors: the
/// daemon cannot be started, or fails, or never says how it is.
[[nodiscard]] Result<BenchTable> run_clients_benchmark(const ClientsBenchmarkOptions& options);

}  // namespace geoflow::tools
