#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/low_state.hpp"

/// DDS itself, behind what the rest of this room needs of it: messages as bytes.
namespace geoflow::drivers::dds {

/// Which messages.
struct Address {
  std::string topic = "rt/lowstate";
  std::uint32_t domain = 0;
  std::string
      interface{};  ///< name of a network interface; empty: what CYCLONEDDS_URI says, or any

  /// `rt/lowstate on eth0, domain 0`.
  [[nodiscard]] std::string to_string() const;
};

/// Gets a message's bytes (CDR). Called on the thread that reads.
class MessageSink {
 public:
  MessageSink() = default;
  MessageSink(const MessageSink&) = delete;
  MessageSink& operator=(const MessageSink&) = delete;
  virtual ~MessageSink() = default;
  virtual void on_message(std::span<const std::byte> cdr, HostTime t_arrival) = 0;
};

/// Where messages come from: DDS, or a script in tests. Thread-bound, but for wake().
class Channel {
 public:
  Channel() = default;
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;
  virtual ~Channel() = default;

  /// Opens, or opens again. The error says what is missing.
  [[nodiscard]] virtual Result<void> open() = 0;
  /// Waits up to `timeout` for messages and hands over those there are. Only while open.
  [[nodiscard]] virtual Result<void> read(MessageSink& sink, Duration timeout) = 0;
  /// Writers of the topic that are known now.
  [[nodiscard]] virtual std::uint32_t writers() const = 0;
  /// Waits, with or without being open, until `timeout` is over or wake() is called.
  virtual void pause(Duration timeout) = 0;
  /// Any thread: ends the wait of read() or pause(), of the next one if there is none now.
  virtual void wake() noexcept = 0;
};

/// A reader of LowState, best effort and of the newest second, that never writes. An error
/// (kUnsupported) where the program was built without DDS.
[[nodiscard]] Result<std::unique_ptr<Channel>> make_subscriber(const Address& address);

/// Writes LowState, for emulation. Thread-bound.
class Publisher {
 public:
  Publisher() = default;
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;
  virtual ~Publisher() = default;
  [[nodiscard]] virtual Result<void> write(const LowState& state) = 0;
  /// Readers of the topic that are known now.
  [[nodiscard]] virtual std::uint32_t readers() const = 0;
};
[[nodiscard]] Result<std::unique_ptr<Publisher>> make_publisher(const Address& address);

}  // namespace geoflow::drivers::dds
