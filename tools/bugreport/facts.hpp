#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace geoflow::tools {

/// This machine: kernel, distribution, processor, memory, time since boot. One fact a line.
[[nodiscard]] std::string machine_facts();

/// What `geoflow doctor` finds, and USB and network devices as the kernel shows them. Serial
/// numbers are a part of it.
[[nodiscard]] std::string device_facts();

/// The end of the daemon's log: its journal, or the file that its standard error goes to. A
/// sentence where neither can be read. `status` is its status reply (its process), or null.
[[nodiscard]] std::string last_log(const nlohmann::json& status);

}  // namespace geoflow::tools
