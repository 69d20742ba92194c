#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"

/// Messages to bytes and back. Pure, thread-safe. Instantiated for every message of messages.hpp
/// that has a `kType`.
namespace geoflow::drivers::cdr {

/// The message in plain CDR of either byte order. Byte sequences in it are views of `bytes`. An
/// error (kInvalidData) says at which byte the message stops to follow its type; so is a message
/// that is longer than its type by more than the padding that transports add.
template <typename Message>
[[nodiscard]] Result<Message> decode(std::span<const std::byte> bytes);

/// The message in little-endian plain CDR with its encapsulation header. Precondition: sequences
/// below 2^32 elements.
template <typename Message>
[[nodiscard]] std::vector<std::byte> encode(const Message& message);

}  // namespace geoflow::drivers::cdr
