#pragma once

#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <tl/expected.hpp>

/// Errors as values. Exceptions never cross a public boundary of this project; anything from
/// outside (file, packet, client, device) that is wrong becomes an `Error` that names what and
/// where.
namespace geoflow {

/// What kind of failure, for code that decides by it (exit codes, recovery). The message is for
/// people.
enum class ErrorCode {
  kNotFound,         ///< a file, topic or device that should be there is not
  kInvalidData,      ///< bytes that do not follow their format
  kInvalidArgument,  ///< a caller's or user's value is out of range or unknown
  kUnsupported,      ///< well-formed, but of a kind that is not handled
  kUnavailable,      ///< a resource is busy, full or gone for now
  kSystem,           ///< the operating system refused; the message carries errno's text
};

/// One failure. `message` is a sentence that names the file, line, message number or key concerned.
struct Error {
  ErrorCode code = ErrorCode::kInvalidData;
  std::string message;

  /// The same failure seen from one level further out: `context: message`.
  [[nodiscard]] Error in(std::string_view context) && {
    message.insert(0, ": ");
    message.insert(0, context);
    return std::move(*this);
  }
};

template <typename T>
using Result = tl::expected<T, Error>;

/// Makes a failed Result: `return fail(ErrorCode::kNotFound, "{}: no such file", path);`
template <typename... Args>
[[nodiscard]] tl::unexpected<Error> fail(ErrorCode code, fmt::format_string<Args...> format,
                                         Args&&... args) {
  return tl::unexpected<Error>{Error{code, fmt::format(format, std::forward<Args>(args)...)}};
}

/// `path: what: <text of errno>` as a kSystem error (kNotFound for ENOENT). Reads errno on entry.
[[nodiscard]] tl::unexpected<Error> fail_errno(std::string_view what);

}  // namespace geoflow
