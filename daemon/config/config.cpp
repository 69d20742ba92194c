#include "geoflow/daemon/config.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>
#include <toml++/toml.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/toml_text.hpp"

#include "config/keys.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::uintmax_t kLargestFile = 1U << 20U;

/// A value that was given, and where: "file:line: key".
struct Given {
  const toml::node& node;
  const Key& key;
  std::string where;
};

tl::unexpected<Error> wrong_type(const Given& given, std::string_view expected) {
  return fail(ErrorCode::kInvalidArgument, "{}: must be {}", given.where, expected);
}

Result<double> number_in_range(const Given& given, bool whole) {
  const auto value = given.node.value<double>();
  if (!given.node.is_number() || (whole && !given.node.is_integer()) || !value) {
    return wrong_type(given, whole ? "a whole number" : "a number");
  }
  if (!std::isfinite(*value) || *value < given.key.minimum || *value > given.key.maximum) {
    return fail(ErrorCode::kInvalidArgument, "{}: {} is out of range, which is {} to {}",
                given.where, *value, given.key.minimum, given.key.maximum);
  }
  return *value;
}

/// Writes the given value to the key's member.
struct Assign {
  const Given& given;

  Result<void> operator()(bool* target) const {
    if (!given.node.is_boolean()) {
      return wrong_type(given, "true or false");
    }
    *target = given.node.value<bool>().value_or(*target);
    return {};
  }
  template <typename Integer>
    requires std::is_same_v<Integer, int> || std::is_same_v<Integer, std::uint64_t>
  Result<void> operator()(Integer* target) const {
    return number_in_range(given, true).map([&](double value) {
      *target = static_cast<Integer>(value);
    });
  }
  Result<void> operator()(double* target) const {
    return number_in_range(given, false).map([&](double value) { *target = value; });
  }
  Result<void> operator()(Duration* target) const {
    return number_in_range(given, false).map([&](double value) { *target = from_seconds(value); });
  }
  template <typename Text>
    requires std::is_same_v<Text, std::string> || std::is_same_v<Text, std::filesystem::path>
  Result<void> operator()(Text* target) const {
    auto value = given.node.value<std::string>();
    if (!value || value->find('\0') != std::string::npos) {
      return wrong_type(given, "a string");
    }
    *target = std::move(*value);
    return {};
  }
};

/// How a value is written in TOML.
struct Format {
  std::string operator()(const bool* value) const { return *value ? "true" : "false"; }
  std::string operator()(const int* value) const { return fmt::format("{}", *value); }
  std::string operator()(const std::uint64_t* value) const { return fmt::format("{}", *value); }
  std::string operator()(const double* value) const { return fmt::format("{}", *value); }
  std::string operator()(const Duration* value) const {
    return fmt::format("{}", to_seconds(*value));
  }
  std::string operator()(const std::string* value) const {
    std::ostringstream out;
    out << toml::value<std::string>{*value};
    return out.str();
  }
  std::string operator()(const std::filesystem::path* value) const {
    const std::string text = value->string();
    return (*this)(&text);
  }
};

/// Sets every key of a parsed document, in its order.
class Reader {
 public:
  Reader(Config& config, std::string_view name, bool with_line)
      : keys_{bind_keys(config)}, name_{name}, with_line_{with_line} {}

  // NOLINTNEXTLINE(misc-no-recursion): the parser bounds the depth
  [[nodiscard]] Result<void> read(const toml::table& table, const std::string& prefix) const {
    for (const auto& [name, node] : table) {
      const std::string key =
          prefix.empty() ? std::string{name.str()} : fmt::format("{}.{}", prefix, name.str());
      const toml::table* section = node.as_table();
      auto done = section != nullptr && !section->empty() ? read(*section, key) : set(key, node);
      if (!done) {
        return done;
      }
    }
    return {};
  }

 private:
  [[nodiscard]] std::string place(const std::string& key, const toml::node& node) const {
    return with_line_ ? fmt::format("{}:{}: {}", name_, node.source().begin.line, key)
                      : fmt::format("{}: {}", name_, key);
  }
  [[nodiscard]] bool is_section(const std::string& name) const {
    return std::ranges::any_of(keys_,
                               [&](const Key& key) { return key.name.starts_with(name + "."); });
  }
  [[nodiscard]] Result<void> set(const std::string& name, const toml::node& node) const {
    for (const Key& key : keys_) {
      if (key.name == name) {
        return std::visit(Assign{Given{.node = node, .key = key, .where = place(name, node)}},
                          key.target);
      }
    }
    if (is_section(name)) {
      return node.is_table() ? Result<void>{}
                             : fail(ErrorCode::kInvalidArgument, "{}: is a section, not a key",
                                    place(name, node));
    }
    return fail(ErrorCode::kInvalidArgument, "{}: unknown key; the nearest known one is {}",
                place(name, node), nearest_key(keys_, name));
  }

  std::vector<Key> keys_;
  std::string_view name_;
  bool with_line_;
};

Result<toml::table> parse(std::string_view text, std::string_view name) {
  if (auto checked = check_toml_text(name, text); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    return fail(ErrorCode::kInvalidArgument, "{}:{}: {}", name, error.source().begin.line,
                error.description());
  }
}

}  // namespace

Result<Config> parse_config(std::string_view text, std::string_view name) {
  auto table = parse(text, name);
  if (!table) {
    return tl::unexpected{std::move(table.error())};
  }
  Config config;
  return Reader{config, name, true}.read(*table, "").map([&] { return std::move(config); });
}

Result<Config> load_config(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream) {
    return fail_errno(file.string());
  }
  std::string text(kLargestFile + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad() || (stream.gcount() == 0 && !stream.eof())) {
    return fail(ErrorCode::kSystem, "{}: cannot be read", file.string());
  }
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > kLargestFile) {
    return fail(ErrorCode::kInvalidArgument, "{}: larger than {} bytes, so not a configuration",
                file.string(), kLargestFile);
  }
  return parse_config(text, file.string());
}

Result<void> set_key(Config& config, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    return fail(ErrorCode::kInvalidArgument, "{}: must be section.key=value", assignment);
  }
  const std::string_view key = assignment.substr(0, equals);
  const std::string_view value = assignment.substr(equals + 1);
  auto table = parse(fmt::format("{} = {}", key, value), "--set");
  if (!table) {
    std::ostringstream quoted;
    quoted << toml::value<std::string>{std::string{value}};
    table = parse(fmt::format("{} = {}", key, quoted.str()), "--set");
  }
  if (!table) {
    return tl::unexpected{std::move(table.error())};
  }
  return Reader{config, "--set", false}.read(*table, "");
}

Result<Config> configure(const std::filesystem::path& file,
                         const std::vector<std::string>& settings) {
  auto config = file.empty() ? Result<Config>{Config{}} : load_config(file);
  for (const std::string& setting : settings) {
    auto set = config ? set_key(*config, setting) : Result<void>{};
    if (!set) {
      return tl::unexpected{std::move(set.error())};
    }
  }
  return config;
}

std::vector<ConfigValue> list_keys(const Config& config) {
  Config copy = config;
  std::vector<ConfigValue> values;
  for (const Key& key : bind_keys(copy)) {
    values.push_back({key.name, std::visit(Format{}, key.target)});
  }
  return values;
}

}  // namespace geoflow::daemon
