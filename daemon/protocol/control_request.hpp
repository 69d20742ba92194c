#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"

/// Requests on the control socket: one JSON object a line (docs/protocol.md).
namespace geoflow::daemon {

struct StatusRequest {};
struct HelpRequest {};
struct UnwatchRequest {};
struct WatchRequest {
  double rate_hz = 0;  ///< poses a second at most; 0: every one
};

struct ConfigRequest {};

/// What changes something: only for whom Authority permits it.
enum class Change : std::uint8_t {
  kSaveMap,
  kResetMap,  ///< begin with an empty map
  kLoadMap,   ///< begin anew in the map of a file
  kReset,     ///< begin anew in the map as it is
  kReload,    ///< read the configuration again
};

struct ChangeRequest {
  Change change = Change::kSaveMap;
  std::filesystem::path file{};  ///< of kLoadMap: an absolute path
};

struct ControlRequest {
  std::variant<StatusRequest, HelpRequest, UnwatchRequest, WatchRequest, ConfigRequest,
               ChangeRequest>
      command;
  std::string name;   ///< the command's word
  nlohmann::json id;  ///< echoed in the reply; null where the client gave none
};

inline constexpr std::size_t kLongestRequest = 4096;  ///< bytes of one line
inline constexpr int kDeepestRequest = 8;             ///< nesting of its JSON

/// Parses one line. kInvalidArgument, naming the key or what is wrong with the JSON. Pure;
/// thread-safe.
[[nodiscard]] Result<ControlRequest> parse_control_request(std::string_view line);

}  // namespace geoflow::daemon
