#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/socket_reader.hpp"

namespace geoflow::drivers::can {

/// CAN interfaces of this machine (SocketCAN): raw sockets, classic and FD frames, error reports.
/// Source: Linux, Documentation/networking/can.rst.
class SocketChannel final : public Channel {
 public:
  /// `interfaces` by their names (`can0`); `known`: the identifiers that are listened to. Error
  /// kSystem when the system has no descriptor left.
  [[nodiscard]] static Result<std::unique_ptr<Channel>> create(
      std::vector<std::string> interfaces, std::vector<LegDictionary::Identifier> known);

  SocketChannel(std::vector<std::string> interfaces, std::vector<LegDictionary::Identifier> known,
                UniqueFd bell);

  [[nodiscard]] Result<void> open() override;
  [[nodiscard]] Result<void> read(std::vector<Received>& frames, Duration timeout) override;
  void listen(Listen to) override;
  [[nodiscard]] std::uint64_t overflowed() const override;
  void pause(Duration timeout) override;
  void wake() noexcept override;

 private:
  void clear_bell() noexcept;

  /// One open interface.
  struct Bus {
    UniqueFd socket;
    SocketReader reader;
  };

  std::vector<std::string> interfaces_;
  std::vector<LegDictionary::Identifier> known_;
  UniqueFd bell_;  // readable while woken
  std::vector<std::unique_ptr<Bus>> buses_;
  std::uint64_t overflowed_before_ = 0;  // of sockets that are closed
};

/// A raw CAN socket on an interface that exists, is a CAN interface and is up; the error says which
/// of these it is not, and how to mend it.
[[nodiscard]] Result<UniqueFd> open_can_socket(const std::string& interface);

}  // namespace geoflow::drivers::can
