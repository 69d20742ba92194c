#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "usb/port.hpp"

namespace geoflow::drivers::d435i::tests {

/// An emulated camera with a clock that only polling moves.
struct PluggedModel {
  std::unique_ptr<emulator::UsbDevice> device;
  HostTime now{std::chrono::seconds{100}};
};

/// The driver's port, with an emulated device at its other end, in one process.
class ModelPort final : public usb::Port {
 public:
  explicit ModelPort(std::shared_ptr<PluggedModel> model) : model_{std::move(model)} {
    info_ = {.vendor = 0x8086,
             .product = 0x0b3a,
             .place = "2-1",
             .serial = "843123050435",
             .super_speed = model_->device->speed() == emulator::UsbSpeed::kSuper};
    (void)control_out({.type = 0x00, .request = 9, .value = 1}, {});  // SET_CONFIGURATION
  }

  [[nodiscard]] const usb::DeviceInfo& info() const override { return info_; }

  Result<std::vector<std::byte>> configuration() override {
    std::vector<std::byte> bytes(65535);
    return control_in({.type = 0x80, .request = 6, .value = 0x0200}, bytes)
        .map([&](std::size_t size) {
          bytes.resize(size);
          return bytes;
        });
  }
  Result<void> claim(std::uint8_t interface) override {
    claimed.push_back(interface);
    return {};
  }

  Result<std::size_t> control_in(const usb::ControlRequest& request,
                                 std::span<std::byte> data) override {
    const auto answer = control(request, {}, data.size());
    if (!answer) {
      return tl::unexpected{answer.error()};
    }
    std::ranges::copy(*answer, data.begin());
    return answer->size();
  }
  Result<void> control_out(const usb::ControlRequest& request,
                           std::span<const std::byte> data) override {
    return control(request, data, data.size()).map([](const auto& /*nothing*/) {});
  }
  Result<void> clear_halt(std::uint8_t endpoint) override {
    return control_out({.type = 0x02, .request = 1, .value = 0, .index = endpoint}, {});
  }

  Result<void> start_in(const usb::InPipe& pipe) override {
    pipes_[pipe.endpoint] = pipe;
    return {};
  }
  void stop_in(std::uint8_t endpoint) override { pipes_.erase(endpoint); }

  Result<void> poll(Duration timeout, usb::InSink& sink) override {
    HostTime due = HostTime::max();
    for (const auto& [endpoint, pipe] : pipes_) {
      due = std::min(due, model_->device->next_due(endpoint, model_->now));
    }
    // A device that has more to say at once is asked again a little later, as a bus would.
    const HostTime soonest = model_->now + std::chrono::microseconds{100};
    model_->now = std::min(std::max(due, soonest), std::max(model_->now + timeout, soonest));
    if (!model_->device->connected(model_->now)) {
      return fail(ErrorCode::kNotFound, "the model is unplugged");
    }
    const auto pipes = pipes_;
    for (const auto& [endpoint, pipe] : pipes) {
      for (auto next = model_->device->next_in(endpoint, model_->now);
           next.status != emulator::InStatus::kNothing;
           next = model_->device->next_in(endpoint, model_->now)) {
        EXPECT_LE(next.data.size(), pipe.transfer_bytes);
        sink.on_transfer(endpoint, status_of(next.status), next.data, model_->now);
        if (next.status == emulator::InStatus::kStall) {
          break;
        }
      }
    }
    return {};
  }

  Result<void> reset() override {
    model_->device->reset(model_->now);
    return {};
  }

  std::vector<std::uint8_t> claimed;

 private:
  static usb::TransferStatus status_of(emulator::InStatus status) {
    if (status == emulator::InStatus::kData) {
      return usb::TransferStatus::kCompleted;
    }
    return status == emulator::InStatus::kStall ? usb::TransferStatus::kStalled
                                                : usb::TransferStatus::kFailed;
  }

  Result<emulator::Bytes> control(const usb::ControlRequest& request,
                                  std::span<const std::byte> out, std::size_t length) {
    auto answer = model_->device->control({.request_type = request.type,
                                           .request = request.request,
                                           .value = request.value,
                                           .index = request.index,
                                           .length = static_cast<std::uint16_t>(length)},
                                          out, model_->now);
    if (!answer) {
      return fail(ErrorCode::kUnavailable, "the model stalls request {:#04x}", request.request);
    }
    return *std::move(answer);
  }

  std::shared_ptr<PluggedModel> model_;
  usb::DeviceInfo info_;
  std::map<std::uint8_t, usb::InPipe> pipes_;
};

}  // namespace geoflow::drivers::d435i::tests
