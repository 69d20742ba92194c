#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

/// The daemon's status reply (docs/protocol.md) as it is shown. What a daemon of another version
/// does not say is left out. Pure; thread-safe.
namespace geoflow::tools {

/// Who it is, and since when: one line.
[[nodiscard]] std::string daemon_line(const nlohmann::json& status);

/// All there is to say, one fact a line.
[[nodiscard]] std::vector<std::string> daemon_lines(const nlohmann::json& status);

/// `512 B`, `1.5 KiB`, `49.0 MiB`, `3.2 GiB`.
[[nodiscard]] std::string bytes_in_words(std::uint64_t bytes);

/// The value at a path of keys with dots between them, if it is there and of that type; else
/// `otherwise`.
[[nodiscard]] double number_at(const nlohmann::json& object, const std::string& path,
                               double otherwise = 0);
[[nodiscard]] std::string text_at(const nlohmann::json& object, const std::string& path);

}  // namespace geoflow::tools
