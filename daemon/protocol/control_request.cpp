#include "protocol/control_request.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {
namespace {

using nlohmann::json;

constexpr double kHighestRateHz = 1000;

Result<json> parse_object(std::string_view line) {
  if (line.size() > kLongestRequest) {
    return fail(ErrorCode::kInvalidArgument, "a request has at most {} bytes", kLongestRequest);
  }
  bool too_deep = false;
  const json::parser_callback_t limit = [&](int depth, json::parse_event_t /*event*/,
                                            json& /*value*/) {
    too_deep = too_deep || depth > kDeepestRequest;
    return !too_deep;
  };
  json value = json::parse(line, limit, false);
  if (too_deep) {
    return fail(ErrorCode::kInvalidArgument, "a request nests at most {} deep", kDeepestRequest);
  }
  if (!value.is_object()) {
    return fail(ErrorCode::kInvalidArgument, "a request is one JSON object on one line");
  }
  return value;
}

/// An error if the object has a key besides cmd, id and those allowed.
Result<void> only_keys(const json& object, std::initializer_list<std::string_view> allowed) {
  for (const auto& item : object.items()) {
    const bool known = item.key() == "cmd" || item.key() == "id" ||
                       std::ranges::find(allowed, item.key()) != allowed.end();
    if (!known) {
      return fail(ErrorCode::kInvalidArgument, "unknown key \"{}\"", item.key());
    }
  }
  return {};
}

Result<WatchRequest> parse_watch(const json& object) {
  const auto stream = object.find("stream");
  if (stream != object.end() && *stream != "pose") {
    return fail(ErrorCode::kInvalidArgument, "stream: must be \"pose\"");
  }
  const auto rate = object.find("rate_hz");
  if (rate == object.end()) {
    return WatchRequest{};
  }
  const double rate_hz = rate->is_number() ? rate->get<double>() : -1.0;
  if (!std::isfinite(rate_hz) || rate_hz < 0.0 || rate_hz > kHighestRateHz) {
    return fail(ErrorCode::kInvalidArgument, "rate_hz: must be a number from 0 to {}",
                kHighestRateHz);
  }
  return WatchRequest{.rate_hz = rate_hz};
}

Result<ChangeRequest> parse_load(const json& object) {
  const auto file = object.find("file");
  if (file == object.end() || !file->is_string()) {
    return fail(ErrorCode::kInvalidArgument, "file: must be the path of a map");
  }
  ChangeRequest request{.change = Change::kLoadMap, .file = file->get<std::string>()};
  if (!request.file.is_absolute()) {
    return fail(ErrorCode::kInvalidArgument, "file: '{}' must be an absolute path",
                request.file.string());
  }
  return request;
}

Result<ChangeRequest> parse_map(const json& object) {
  const auto what = object.find("do");
  const std::string word =
      what != object.end() && what->is_string() ? what->get<std::string>() : std::string{};
  if (word == "load") {
    return only_keys(object, {"do", "file"}).and_then([&] { return parse_load(object); });
  }
  if (word == "save" || word == "reset") {
    return only_keys(object, {"do"}).map([&] {
      return ChangeRequest{.change = word == "save" ? Change::kSaveMap : Change::kResetMap};
    });
  }
  return fail(ErrorCode::kInvalidArgument, R"(do: must be "save", "load" or "reset")");
}

using Command = decltype(ControlRequest::command);

Result<Command> parse_command(const json& object, const std::string& name) {
  const auto as_command = [](auto parsed) { return Command{parsed}; };
  if (name == "watch") {
    return only_keys(object, {"stream", "rate_hz"}).and_then([&] {
      return parse_watch(object).map(as_command);
    });
  }
  if (name == "map") {
    return parse_map(object).map(as_command);
  }
  static const std::map<std::string, Command, std::less<>> plain = {
      {"help", HelpRequest{}},
      {"status", StatusRequest{}},
      {"unwatch", UnwatchRequest{}},
      {"config", ConfigRequest{}},
      {"reset", ChangeRequest{.change = Change::kReset}},
      {"reload", ChangeRequest{.change = Change::kReload}}};
  const auto found = plain.find(name);
  if (found == plain.end()) {
    return fail(ErrorCode::kInvalidArgument,
                "cmd: must be one of help, status, watch, unwatch, config, map, reset, reload");
  }
  return only_keys(object, {}).map([&] { return found->second; });
}

}  // namespace

Result<ControlRequest> parse_control_request(std::string_view line) {
  const auto object = parse_object(line);
  if (!object) {
    return tl::unexpected{object.error()};
  }
  const auto cmd = object->find("cmd");
  if (cmd == object->end() || !cmd->is_string()) {
    return fail(ErrorCode::kInvalidArgument, "cmd: must be a string");
  }
  const auto id = object->find("id");
  if (id != object->end() && !id->is_string() && !id->is_number_integer()) {
    return fail(ErrorCode::kInvalidArgument, "id: must be a string or a whole number");
  }
  auto name = cmd->get<std::string>();
  return parse_command(*object, name).map([&](const Command& command) {
    return ControlRequest{
        .command = command, .name = name, .id = id == object->end() ? json{} : *id};
  });
}

}  // namespace geoflow::daemon
