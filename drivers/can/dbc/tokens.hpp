#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::can::dbc {

enum class TokenKind : std::uint8_t {
  kWord,    ///< a name or keyword
  kNumber,  ///< with its sign
  kText,    ///< between quotation marks, which are not part of it
  kSign,    ///< any other single character
  kEnd,     ///< of the file
};

/// One token, a view of the text.
struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::string_view text;
  std::size_t line = 1;
  bool first_of_line = false;  ///< stands at the very beginning of its line
};

/// Reads the text of a DBC file token by token. The first thing that is wrong is kept, with its
/// line; from then on the text is at its end, and what is read is empty or 0, so that callers ask
/// once, at the end of a statement. Thread-bound.
class Tokens {
 public:
  /// `name` stands for the file in errors. Both must outlive this.
  Tokens(std::string_view text, std::string_view name) noexcept : text_{text}, name_{name} {}

  /// The next token, which stays the next one.
  [[nodiscard]] Token peek();
  /// The next token; kEnd behind the last one, any number of times.
  Token next();

  /// The next token, which must be of a kind. `what` is how an error calls what is expected.
  Token word(std::string_view what) { return of_kind(TokenKind::kWord, what); }
  Token text(std::string_view what) { return of_kind(TokenKind::kText, what); }
  double number(std::string_view what);
  std::uint32_t whole(std::string_view what);
  /// The next token must be this character.
  void sign(char expected);
  /// Takes the next token if it is this character.
  [[nodiscard]] bool take(char expected);

  /// Passes over everything up to and with the next semicolon.
  void skip_to_semicolon();
  /// Passes over everything before the next word at the beginning of a line.
  void skip_to_line_start();

  /// Something is wrong with what stands in `line`.
  void refuse(std::size_t line, std::string_view what);
  [[nodiscard]] bool ok() const noexcept { return !error_; }
  /// What was wrong, as `name:line: what`.
  [[nodiscard]] Result<void> outcome() const;

 private:
  Token of_kind(TokenKind kind, std::string_view what);
  void skip_blanks() noexcept;
  [[nodiscard]] Token cut(TokenKind kind, std::size_t size) noexcept;

  std::string_view text_;
  std::string_view name_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
  std::optional<Error> error_;
};

}  // namespace geoflow::drivers::can::dbc
