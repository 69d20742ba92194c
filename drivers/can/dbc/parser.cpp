#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "can/dbc/database.hpp"
#include "can/dbc/signal.hpp"
#include "can/dbc/tokens.hpp"
#include "can/frame.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers::can::dbc {
namespace {

constexpr std::size_t kLargestFile = 1U << 20U;
constexpr std::uint32_t kExtendedFlag = 1U << 31U;  // of an identifier in a DBC file
constexpr std::uint32_t kLargestExtended = (1U << 29U) - 1;
constexpr std::uint32_t kLargestStandard = (1U << 11U) - 1;
constexpr std::uint32_t kNoFrame = 0xC0000000;  // VECTOR__INDEPENDENT_SIG_MSG: signals of no frame
constexpr std::uint8_t kFloat32Bits = 32;
constexpr std::uint8_t kFloat64Bits = 64;

// The values of the attribute VFrameFormat that mean CAN FD, as number and by name.
constexpr std::string_view kFrameFormat = "VFrameFormat";
constexpr std::array<std::string_view, 4> kFdFormats = {"14", "15", "StandardCAN_FD",
                                                        "ExtendedCAN_FD"};

// Statements that say nothing about where a value lies: passed over up to their semicolon.
constexpr std::array<std::string_view, 25> kPassedOver = {
    "VAL_TABLE_",    "BO_TX_BU_",   "EV_",         "ENVVAR_DATA_",    "EV_DATA_",
    "SGTYPE_",       "VAL_",        "SIG_GROUP_",  "SGTYPE_VAL_",     "CM_",
    "BA_DEF_",       "BA_DEF_DEF_", "BA_DEF_REL_", "BA_DEF_DEF_REL_", "BA_REL_",
    "BU_SG_REL_",    "BU_EV_REL_",  "BU_BO_REL_",  "BA_DEF_SGTYPE_",  "BA_SGTYPE_",
    "SIG_TYPE_REF_", "CAT_DEF_",    "CAT_",        "FILTER",          "SIGTYPE_VALTYPE_"};

/// A signal as it is declared, before it is known to fit its message.
struct Declared {
  Signal signal;
  std::uint32_t start_bit = 0;
  std::uint32_t bits = 0;
  std::uint32_t order = 0;  // 1: Intel, 0: Motorola
};

/// Reads one database, statement by statement. The first error ends it.
class Parser {
 public:
  Parser(std::string_view text, std::string_view name) : tokens_{text, name} {
    database_.name = name;
  }

  Result<Database> parse() {
    for (Token token = tokens_.next(); token.kind != TokenKind::kEnd; token = tokens_.next()) {
      statement(token);
    }
    if (auto read = tokens_.outcome(); !read) {
      return tl::unexpected{std::move(read.error())};
    }
    if (database_.messages.empty()) {
      return fail(ErrorCode::kInvalidData, "{}: has no message (BO_)", database_.name);
    }
    return std::move(database_);
  }

 private:
  void statement(const Token& keyword) {
    const std::string_view word = keyword.text;
    if (keyword.kind != TokenKind::kWord) {
      tokens_.refuse(keyword.line, fmt::format("'{}' where a statement begins", word));
    } else if (word == "VERSION") {
      (void)tokens_.text("a version in quotation marks");
    } else if (word == "NS_" || word == "BS_" || word == "BU_") {
      tokens_.skip_to_line_start();  // these have no end of their own
    } else if (word == "BO_") {
      message(keyword.line);
    } else if (word == "SG_") {
      signal(keyword.line);
    } else if (word == "SIG_VALTYPE_") {
      value_type();
    } else if (word == "BA_") {
      attribute();
    } else if (word == "SG_MUL_VAL_") {
      tokens_.refuse(keyword.line, "extended multiplexing (SG_MUL_VAL_) is not supported");
    } else if (std::ranges::find(kPassedOver, word) != kPassedOver.end()) {
      tokens_.skip_to_semicolon();
    } else {
      tokens_.refuse(keyword.line, fmt::format("'{}' is no statement of a DBC file", word));
    }
  }

  /// `BO_ 272 FR_POS: 8 LEG_FR`
  void message(std::size_t line) {
    const std::uint32_t id = tokens_.whole("a message's identifier");
    const Token name = tokens_.word("a message's name");
    tokens_.sign(':');
    const std::uint32_t length = tokens_.whole("a message's length");
    (void)tokens_.word("a message's sender");
    place_of_signals_ = PlaceOfSignals::kNowhere;
    if (!tokens_.ok()) {
      return;
    }
    if (id == kNoFrame) {
      place_of_signals_ = PlaceOfSignals::kOutside;
      return;
    }
    const bool extended = (id & kExtendedFlag) != 0;
    if ((id & ~kExtendedFlag) > (extended ? kLargestExtended : kLargestStandard)) {
      tokens_.refuse(line, fmt::format("message {} has an identifier of more than {} bits",
                                       name.text, extended ? "29" : "11"));
    }
    if (length > kFdBytes) {
      tokens_.refuse(line, fmt::format("message {} is of {} bytes; at most {} fit", name.text,
                                       length, kFdBytes));
    }
    const auto [other, is_new] = by_id_.try_emplace(id, database_.messages.size());
    if (!is_new) {
      const Message& first = database_.messages[other->second];
      tokens_.refuse(line, fmt::format("message {} has the identifier of {} in line {}", name.text,
                                       first.name, first.line));
    }
    database_.messages.push_back({.id = id & ~kExtendedFlag,
                                  .extended = extended,
                                  .fd = length > kClassicBytes,
                                  .name = std::string{name.text},
                                  .length = length,
                                  .line = line});
    names_.clear();
    place_of_signals_ = PlaceOfSignals::kMessage;
  }

  /// `SG_ FR_hip_q : 0|16@1- (0.0002,0) [-6.5536|6.5534] "rad" HOST`
  void signal(std::size_t line) {
    Declared declared;
    declared.signal.line = line;
    declared.signal.name = tokens_.word("a signal's name").text;
    multiplexing(declared.signal);
    tokens_.sign(':');
    declared.start_bit = tokens_.whole("a start bit");
    tokens_.sign('|');
    declared.bits = tokens_.whole("a number of bits");
    tokens_.sign('@');
    declared.order = tokens_.whole("a byte order, 0 or 1");
    declared.signal.type = tokens_.take('-') ? ValueType::kSigned : ValueType::kUnsigned;
    if (declared.signal.type == ValueType::kUnsigned) {
      tokens_.sign('+');
    }
    tokens_.sign('(');
    declared.signal.factor = tokens_.number("a factor");
    tokens_.sign(',');
    declared.signal.offset = tokens_.number("an offset");
    tokens_.sign(')');
    tokens_.sign('[');
    declared.signal.minimum = tokens_.number("a minimum");
    tokens_.sign('|');
    declared.signal.maximum = tokens_.number("a maximum");
    tokens_.sign(']');
    declared.signal.unit = tokens_.text("a unit in quotation marks").text;
    do {
      (void)tokens_.word("a receiver");
    } while (tokens_.take(','));
    if (tokens_.ok() && place_of_signals_ == PlaceOfSignals::kNowhere) {
      tokens_.refuse(line, "a signal (SG_) that follows no message (BO_)");
    }
    if (tokens_.ok() && place_of_signals_ == PlaceOfSignals::kMessage) {
      place(std::move(declared), database_.messages.back());
    }
  }

  /// `M`, `m3` or nothing, up to the colon.
  void multiplexing(Signal& signal) {
    if (tokens_.peek().kind != TokenKind::kWord) {
      return;
    }
    const Token token = tokens_.next();
    if (token.text == "M") {
      signal.multiplexor = true;
      return;
    }
    std::uint64_t value = 0;
    const std::string_view digits = token.text.substr(1);
    const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (token.text.front() != 'm' || failed != std::errc{} ||
        end != digits.data() + digits.size()) {
      tokens_.refuse(token.line,
                     fmt::format("'{}' is no multiplexing (M, or m and a number)", token.text));
    }
    signal.multiplexed_by = value;
  }

  void place(Declared declared, Message& message) {
    Signal& signal = declared.signal;
    const auto refuse = [&](std::string_view why) {
      tokens_.refuse(signal.line,
                     fmt::format("signal {} of message {}: {}", signal.name, message.name, why));
    };
    if (declared.order > 1) {
      return refuse(fmt::format("byte order {} is neither 0 nor 1", declared.order));
    }
    const auto field =
        bit_field(declared.start_bit, declared.bits,
                  declared.order == 1 ? ByteOrder::kIntel : ByteOrder::kMotorola, message.length);
    if (!field) {
      return refuse(fmt::format("{} bits from bit {} on are not within {} bytes", declared.bits,
                                declared.start_bit, message.length));
    }
    if (signal.factor == 0) {
      return refuse("its factor is 0");
    }
    if (!names_.insert(signal.name).second) {
      return refuse("is there twice");
    }
    if (signal.multiplexor && std::ranges::any_of(message.signals, &Signal::multiplexor)) {
      return refuse("is a second multiplexor");
    }
    signal.field = *field;
    message.signals.push_back(std::move(signal));
  }

  /// `SIG_VALTYPE_ id signal : 1;` makes a signal a float, 2 a double.
  void value_type() {
    const std::uint32_t id = tokens_.whole("a message's identifier");
    const Token name = tokens_.word("a signal's name");
    (void)tokens_.take(':');
    const std::uint32_t type = tokens_.whole("0, 1 or 2");
    tokens_.sign(';');
    Message* const message = find(id, name.line);
    if (message == nullptr) {
      return;
    }
    const auto signal = std::ranges::find(message->signals, name.text, &Signal::name);
    if (signal == message->signals.end()) {
      return tokens_.refuse(name.line,
                            fmt::format("message {} has no signal {}", message->name, name.text));
    }
    if (type > 2 ||
        (type != 0 && signal->field.bits != (type == 1 ? kFloat32Bits : kFloat64Bits))) {
      return tokens_.refuse(name.line, fmt::format("signal {} of {} bits cannot be of type {}",
                                                   name.text, signal->field.bits, type));
    }
    if (type != 0) {
      signal->type = type == 1 ? ValueType::kFloat32 : ValueType::kFloat64;
    }
  }

  /// `BA_ "VFrameFormat" BO_ id 14;` says that a message is CAN FD; others say nothing here.
  void attribute() {
    const Token name = tokens_.text("an attribute's name in quotation marks");
    if (name.text != kFrameFormat || tokens_.peek().text != "BO_") {
      return tokens_.skip_to_semicolon();
    }
    (void)tokens_.next();
    const std::uint32_t id = tokens_.whole("a message's identifier");
    const Token format = tokens_.next();
    tokens_.sign(';');
    Message* const message = find(id, name.line);
    if (message == nullptr) {
      return;
    }
    message->fd = std::ranges::find(kFdFormats, format.text) != kFdFormats.end();
    if (!message->fd && message->length > kClassicBytes) {
      tokens_.refuse(name.line, fmt::format("message {} is of {} bytes, so it must be CAN FD",
                                            message->name, message->length));
    }
  }

  /// The message that a statement in `line` names; null where there is nothing to be done for it.
  Message* find(std::uint32_t id, std::size_t line) {
    if (!tokens_.ok() || id == kNoFrame) {
      return nullptr;
    }
    const auto found = by_id_.find(id);
    if (found == by_id_.end()) {
      tokens_.refuse(line, fmt::format("there is no message {}", id));
      return nullptr;
    }
    return &database_.messages[found->second];
  }

  enum class PlaceOfSignals : std::uint8_t { kNowhere, kMessage, kOutside };

  Tokens tokens_;
  Database database_;
  std::map<std::uint32_t, std::size_t> by_id_;  // identifier as in the file -> index of the message
  std::set<std::string, std::less<>> names_;    // of the last message's signals
  PlaceOfSignals place_of_signals_ = PlaceOfSignals::kNowhere;
};

}  // namespace

const Signal* Message::find(std::string_view signal) const noexcept {
  const auto found = std::ranges::find(signals, signal, &Signal::name);
  return found == signals.end() ? nullptr : &*found;
}

const Message* Database::find(std::string_view message) const noexcept {
  const auto found = std::ranges::find(messages, message, &Message::name);
  return found == messages.end() ? nullptr : &*found;
}

Result<Database> parse(std::string_view text, std::string_view name) {
  return Parser{text, name}.parse();
}

Result<Database> load(const std::filesystem::path& file) {
  return text::read_file(file, kLargestFile).and_then([&](const std::string& content) {
    return parse(content, file.string());
  });
}

}  // namespace geoflow::drivers::can::dbc
