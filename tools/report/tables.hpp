#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/tools/evaluate/consistency.hpp"

#include "report/accuracy.hpp"
#include "report/streams.hpp"

/// The report's tables as the page takes them: `columns` and `rows` of texts. Pure. What a run's
/// report has in another form than `geoflow replay` gives it is left out.
namespace geoflow::tools {

/// The statistics that `geoflow evaluate` prints, of both trajectories.
[[nodiscard]] nlohmann::json error_table(const Accuracy& accuracy);
/// By status, as `geoflow evaluate --estimates` prints it.
[[nodiscard]] nlohmann::json consistency_table(const Consistency& consistency);
/// Frames by status.
[[nodiscard]] nlohmann::json status_table(const nlohmann::json& report);
/// What was lost on the way: samples dropped, rejected, late or hit by a fault script.
[[nodiscard]] nlohmann::json loss_table(const nlohmann::json& report);
/// `times_ms`.
[[nodiscard]] nlohmann::json time_table(const nlohmann::json& report);
[[nodiscard]] nlohmann::json stream_table(const RecordingTimes& times);
/// The summary of `geoflow bench table`'s table.json.
[[nodiscard]] nlohmann::json ablation_table(const nlohmann::json& table);
[[nodiscard]] nlohmann::json configuration_table(const nlohmann::json& report);

/// The text at a key; empty where there is none.
[[nodiscard]] std::string text_of(const nlohmann::json& object, std::string_view key);

}  // namespace geoflow::tools
