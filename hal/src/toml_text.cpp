#include "geoflow/hal/toml_text.hpp"

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <string_view>

#include "geoflow/hal/result.hpp"

namespace geoflow {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

bool may_begin_key(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '"' ||
         c == '\'' || c == ']';
}

bool is_plain(char c) {
  return c == '\t' || c == '\n' || c == '\r' || (c >= ' ' && c <= '~');
}

/// Length of the comment that `text` begins with, without its line's end.
std::size_t comment_length(std::string_view text) {
  return std::min(text.find_first_of("\r\n"), text.size());
}

/// Length of the string that `text` begins with, with both its quotes; all of `text` where it has
/// no end. A string of one line ends at its line's end: the parser refuses it there.
std::size_t string_length(std::string_view text) {
  const char quote = text.front();
  const std::string_view triple = quote == '"' ? R"(""")" : "'''";
  const bool many_lines = text.starts_with(triple);
  const std::string_view end = many_lines ? triple : triple.substr(0, 1);
  for (std::size_t i = end.size(); i < text.size(); ++i) {
    if (text.substr(i).starts_with(end)) {
      return i + end.size();
    }
    if (!many_lines && (text[i] == '\n' || text[i] == '\r')) {
      return i;
    }
    i += quote == '"' && text[i] == '\\' ? 1U : 0U;
  }
  return text.size();
}

/// Whether a key may follow the one or two brackets that `text` begins with.
bool is_header(std::string_view text) {
  const std::size_t brackets = text.starts_with("[[") ? 2 : 1;
  const std::size_t key = text.find_first_not_of(" \t", brackets);
  return key == std::string_view::npos || may_begin_key(text[key]);
}

}  // namespace

Result<void> check_toml_text(std::string_view name, std::string_view text) {
  const auto line_of = [&](std::size_t at) {
    return 1 + std::ranges::count(text.substr(0, at), '\n');
  };
  std::size_t length = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  for (std::size_t at = length; at < text.size(); at += length) {
    const std::string_view rest = text.substr(at);
    length = 1;
    if (rest.front() == '#') {
      length = comment_length(rest);
    } else if (rest.front() == '"' || rest.front() == '\'') {
      length = string_length(rest);
    } else if (!is_plain(rest.front())) {
      return fail(ErrorCode::kInvalidArgument,
                  "{}:{}: not TOML: outside of strings and comments only ASCII text is expected",
                  name, line_of(at));
    } else if (rest.front() == '[') {
      if (!is_header(rest)) {
        return fail(ErrorCode::kInvalidArgument,
                    "{}:{}: not TOML: the name of a table is expected behind the bracket", name,
                    line_of(at));
      }
      length = rest.starts_with("[[") ? 2 : 1;
    }
  }
  return {};
}

}  // namespace geoflow
