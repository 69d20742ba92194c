#include "can/dbc/tokens.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <system_error>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/text.hpp"

namespace geoflow::drivers::can::dbc {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}

bool is_letter(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

/// Bytes of the number that `text` begins with; 0 if it begins with none.
std::size_t number_size(std::string_view text) noexcept {
  std::size_t at = !text.empty() && (text[0] == '+' || text[0] == '-') ? 1 : 0;
  if (at >= text.size() || (!is_digit(text[at]) && text[at] != '.')) {
    return 0;
  }
  for (; at < text.size(); ++at) {
    const char c = text[at];
    const bool exponent_sign =
        (c == '+' || c == '-') && (text[at - 1] == 'e' || text[at - 1] == 'E');
    if (!is_digit(c) && c != '.' && c != 'e' && c != 'E' && !exponent_sign) {
      break;
    }
  }
  return at;
}

std::size_t word_size(std::string_view text) noexcept {
  const auto* const end =
      std::ranges::find_if_not(text, [](char c) { return is_letter(c) || is_digit(c); });
  return static_cast<std::size_t>(end - text.begin());
}

}  // namespace

void Tokens::skip_blanks() noexcept {
  while (at_ < text_.size() && kBlanks.find(text_[at_]) != std::string_view::npos) {
    line_ += text_[at_] == '\n' ? 1U : 0U;
    ++at_;
  }
}

Token Tokens::cut(TokenKind kind, std::size_t size) noexcept {
  const Token token{.kind = kind,
                    .text = text_.substr(at_, size),
                    .line = line_,
                    .first_of_line = at_ == 0 || text_[at_ - 1] == '\n'};
  at_ += size;
  return token;
}

Token Tokens::next() {
  skip_blanks();
  const std::string_view rest = text_.substr(at_);
  if (rest.empty()) {
    return cut(TokenKind::kEnd, 0);
  }
  if (rest.front() == '\0') {
    refuse(line_, "a zero byte in a text file");
    return cut(TokenKind::kEnd, 0);
  }
  if (rest.front() == '"') {
    const std::size_t size = rest.find('"', 1);
    if (size == std::string_view::npos) {
      refuse(line_, "a text has no closing quotation mark");
      return cut(TokenKind::kEnd, 0);
    }
    Token token = cut(TokenKind::kText, size + 1);
    token.text = token.text.substr(1, size - 1);
    line_ += static_cast<std::size_t>(std::ranges::count(token.text, '\n'));
    return token;
  }
  if (const std::size_t size = number_size(rest); size > 0) {
    return cut(TokenKind::kNumber, size);
  }
  const std::size_t size = word_size(rest);
  return size > 0 ? cut(TokenKind::kWord, size) : cut(TokenKind::kSign, 1);
}

Token Tokens::peek() {
  const std::size_t at = at_;
  const std::size_t line = line_;
  const Token token = next();
  if (ok()) {
    at_ = at;
    line_ = line;
  }
  return token;
}

Token Tokens::of_kind(TokenKind kind, std::string_view what) {
  const Token token = next();
  if (token.kind == kind) {
    return token;
  }
  refuse(token.line, token.kind == TokenKind::kEnd
                         ? fmt::format("the file ends where {} is expected", what)
                         : fmt::format("'{}' where {} is expected", token.text, what));
  return {};
}

double Tokens::number(std::string_view what) {
  const Token token = of_kind(TokenKind::kNumber, what);
  const std::string_view digits = token.text.starts_with('+') ? token.text.substr(1) : token.text;
  const auto value = text::parse_number(digits);
  if (!value) {
    refuse(token.line, fmt::format("'{}' is not {}", token.text, what));
  }
  return value.value_or(0);
}

std::uint32_t Tokens::whole(std::string_view what) {
  const Token token = of_kind(TokenKind::kNumber, what);
  std::uint32_t value = 0;
  const std::string_view digits = token.text;
  const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (failed != std::errc{} || end != digits.data() + digits.size()) {
    refuse(token.line, fmt::format("'{}' is not {}", token.text, what));
    return 0;
  }
  return value;
}

void Tokens::sign(char expected) {
  const Token token = of_kind(TokenKind::kSign, fmt::format("'{}'", expected));
  if (ok() && token.text.front() != expected) {
    refuse(token.line, fmt::format("'{}' where '{}' is expected", token.text, expected));
  }
}

bool Tokens::take(char expected) {
  const Token token = peek();
  const bool there = token.kind == TokenKind::kSign && token.text.front() == expected;
  if (there) {
    (void)next();
  }
  return there;
}

void Tokens::skip_to_semicolon() {
  const std::size_t begin = line_;
  while (!take(';')) {
    if (next().kind == TokenKind::kEnd) {
      refuse(begin, "a statement has no semicolon at its end");
      return;
    }
  }
}

void Tokens::skip_to_line_start() {
  for (Token token = peek(); token.kind != TokenKind::kEnd; token = peek()) {
    if (token.kind == TokenKind::kWord && token.first_of_line) {
      return;
    }
    (void)next();
  }
}

void Tokens::refuse(std::size_t line, std::string_view what) {
  if (!error_) {
    error_ = Error{.code = ErrorCode::kInvalidData,
                   .message = fmt::format("{}:{}: {}", name_, line, what)};
  }
  at_ = text_.size();
}

Result<void> Tokens::outcome() const {
  return error_ ? Result<void>{tl::unexpected{*error_}} : Result<void>{};
}

}  // namespace geoflow::drivers::can::dbc
