#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "can/dbc/signal.hpp"

/// A CAN database in Vector's DBC format: which bits of which frame mean what. Read are BO_ and
/// SG_ (multiplexed by M and mN), SIG_VALTYPE_ and the attribute VFrameFormat; the format's other
/// statements are passed over; what is no statement of the format, or is wrong, is an error.
namespace geoflow::drivers::can::dbc {

/// One frame of the dictionary.
struct Message {
  std::uint32_t id = 0;
  bool extended = false;  ///< identifier of 29 bits
  bool fd = false;
  std::string name{};
  std::size_t length = 0;  ///< payload [B]
  std::vector<Signal> signals{};
  std::size_t line = 0;  ///< where it stands in the file, from 1

  /// The signal of this name, or null.
  [[nodiscard]] const Signal* find(std::string_view signal) const noexcept;
};

struct Database {
  std::string name{};               ///< of the file, for messages
  std::vector<Message> messages{};  ///< in the file's order; no two have the same identifier

  /// The message of this name, or null.
  [[nodiscard]] const Message* find(std::string_view message) const noexcept;
};

/// Reads a database from text; `name` stands for the file in errors, which name the line as well.
/// A database without messages is an error. Memory stays within a small multiple of the text.
[[nodiscard]] Result<Database> parse(std::string_view text, std::string_view name);

/// The same from a file of at most 1 MiB.
[[nodiscard]] Result<Database> load(const std::filesystem::path& file);

}  // namespace geoflow::drivers::can::dbc
