#include "replay/cdr/cursor.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>

namespace geoflow::drivers::cdr {
namespace {

// Representation identifiers (OMG DDSI-RTPS 2.5, table 10.3); the two bytes after them are options
// that plain CDR ignores.
constexpr std::byte kPlainBigEndian{0};
constexpr std::byte kPlainLittleEndian{1};

std::size_t padding(std::size_t at, std::size_t alignment) {
  return (alignment - at % alignment) % alignment;
}

}  // namespace

Reader::Reader(std::span<const std::byte> message) : message_{message} {
  if (message.size() < kEncapsulationBytes) {
    set_error(fmt::format("{} bytes are too few for a CDR message", message.size()));
    return;
  }
  if (message[0] != std::byte{0} ||
      (message[1] != kPlainBigEndian && message[1] != kPlainLittleEndian)) {
    set_error(fmt::format("CDR representation {:02x}{:02x} is not plain CDR (0000 or 0001)",
                          std::to_integer<unsigned>(message[0]),
                          std::to_integer<unsigned>(message[1])));
    return;
  }
  swap_ = (message[1] == kPlainLittleEndian) != (std::endian::native == std::endian::little);
  at_ = kEncapsulationBytes;
}

const std::byte* Reader::take(std::size_t alignment, std::size_t size) {
  if (error_) {
    return nullptr;
  }
  const std::size_t skip = padding(at_ - kEncapsulationBytes, alignment);
  if (remaining() < skip || remaining() - skip < size) {
    set_error(fmt::format("the CDR message ends at byte {}, inside a value of {} bytes at byte {}",
                          message_.size(), size, at_ + skip));
    return nullptr;
  }
  const std::byte* first = message_.data() + at_ + skip;
  at_ += skip + size;
  return first;
}

std::size_t Reader::read_length(std::size_t least_bytes_each) {
  std::uint32_t length = 0;
  read(length);
  if (!error_ && length > remaining() / least_bytes_each) {
    set_error(fmt::format(
        "a sequence of {} elements at byte {} is longer than the rest of the CDR message, {} bytes",
        length, at_ - sizeof(length), remaining()));
  }
  return error_ ? 0 : length;
}

void Reader::read(std::string& text) {
  text.clear();
  const std::size_t length = read_length(1);
  const std::byte* first = take(1, length);
  if (first == nullptr || length == 0) {
    return;
  }
  if (first[length - 1] != std::byte{0}) {
    set_error(fmt::format("a string that ends at byte {} has no terminating zero", at_));
    return;
  }
  text.resize(length - 1);
  std::memcpy(text.data(), first, length - 1);
}

void Reader::read(std::span<const std::byte>& bytes) {
  const std::size_t length = read_length(1);
  if (const std::byte* first = take(1, length)) {
    bytes = {first, length};
  }
}

void Reader::set_error(std::string what) {
  if (!error_) {
    error_ = std::move(what);
  }
}

Writer::Writer() : message_{std::byte{0}, kPlainLittleEndian, std::byte{0}, std::byte{0}} {}

void Writer::write(const std::string& text) {
  // c_str: the terminating zero is on the wire and counted.
  write(std::as_bytes(std::span{text.c_str(), text.size() + 1}));
}

void Writer::write(std::span<const std::byte> bytes) {
  write(static_cast<std::uint32_t>(bytes.size()));
  append(1, bytes);
}

void Writer::append(std::size_t alignment, std::span<const std::byte> bytes) {
  message_.resize(message_.size() + padding(message_.size() - kEncapsulationBytes, alignment));
  message_.insert(message_.end(), bytes.begin(), bytes.end());
}

}  // namespace geoflow::drivers::cdr
