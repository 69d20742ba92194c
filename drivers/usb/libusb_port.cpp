#include "usb/libusb_port.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <libusb-1.0/libusb.h>
#include <sys/time.h>
#include <tl/expected.hpp>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "usb/port.hpp"

namespace geoflow::drivers::usb {
namespace {

constexpr unsigned kControlTimeout_ms = 500;
constexpr Duration kCancelTimeout = std::chrono::milliseconds{500};
constexpr std::size_t kDeepestHub = 7;  // USB 3.2, 4.1.1
constexpr std::size_t kLongestString = 128;

using ContextPtr = std::unique_ptr<libusb_context, decltype(&libusb_exit)>;
using HandlePtr = std::unique_ptr<libusb_device_handle, decltype(&libusb_close)>;
using TransferPtr = std::unique_ptr<libusb_transfer, decltype(&libusb_free_transfer)>;

tl::unexpected<Error> usb_error(std::string_view what, int code) {
  ErrorCode kind = ErrorCode::kSystem;
  if (code == LIBUSB_ERROR_NO_DEVICE || code == LIBUSB_ERROR_NOT_FOUND) {
    kind = ErrorCode::kNotFound;
  } else if (code == LIBUSB_ERROR_PIPE || code == LIBUSB_ERROR_TIMEOUT ||
             code == LIBUSB_ERROR_BUSY) {
    kind = ErrorCode::kUnavailable;
  }
  return fail(kind, "{}: {}", what, libusb_strerror(code));
}

std::string place_of(libusb_device* device) {
  std::array<std::uint8_t, kDeepestHub> ports{};
  const int count = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string place = fmt::format("{}", libusb_get_bus_number(device));
  for (int i = 0; i < count; ++i) {
    place += fmt::format("{}{}", i == 0 ? '-' : '.', ports.at(static_cast<std::size_t>(i)));
  }
  return place;
}

std::string serial_of(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, kLongestString> text{};
  const int length = index == 0 ? 0
                                : libusb_get_string_descriptor_ascii(handle, index, text.data(),
                                                                     static_cast<int>(text.size()));
  return {text.begin(), text.begin() + std::max(length, 0)};
}

Result<ContextPtr> make_context() {
  libusb_context* context = nullptr;
  if (const int code = libusb_init(&context); code != 0) {
    return usb_error("USB cannot be looked at", code);
  }
  return ContextPtr{context, &libusb_exit};
}

/// A device that was found; its handle is null where it may not be opened.
struct Found {
  DeviceInfo info;
  HandlePtr handle{nullptr, &libusb_close};
  int open_code = 0;
};

Found describe(libusb_device* device, const libusb_device_descriptor& descriptor) {
  Found found{.info = {.vendor = descriptor.idVendor,
                       .product = descriptor.idProduct,
                       .place = place_of(device),
                       .serial = {},
                       .super_speed = libusb_get_device_speed(device) >= LIBUSB_SPEED_SUPER}};
  libusb_device_handle* handle = nullptr;
  found.open_code = libusb_open(device, &handle);
  if (found.open_code == 0) {
    found.handle.reset(handle);
    found.info.serial = serial_of(handle, descriptor.iSerialNumber);
  }
  return found;
}

Result<std::vector<Found>> find(libusb_context* context, std::uint16_t vendor,
                                std::uint16_t product) {
  libusb_device** devices = nullptr;
  const auto count = libusb_get_device_list(context, &devices);
  if (count < 0) {
    return usb_error("USB's devices cannot be listed", static_cast<int>(count));
  }
  std::vector<Found> all;
  for (libusb_device* device : std::span{devices, static_cast<std::size_t>(count)}) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(device, &descriptor) == 0 && descriptor.idVendor == vendor &&
        descriptor.idProduct == product) {
      all.push_back(describe(device, descriptor));
    }
  }
  libusb_free_device_list(devices, 1);
  std::ranges::sort(all, {}, [](const Found& found) { return found.info.place; });
  return all;
}

class LibusbPort final : public Port {
 public:
  LibusbPort(ContextPtr context, Found found)
      : context_{std::move(context)},
        info_{std::move(found.info)},
        handle_{std::move(found.handle)} {
    libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
  }
  ~LibusbPort() override {
    while (!pipes_.empty()) {
      stop_in(pipes_.back()->endpoint);
    }
    for (const std::uint8_t interface : claimed_) {
      libusb_release_interface(handle_.get(), interface);
    }
  }
  LibusbPort(const LibusbPort&) = delete;
  LibusbPort& operator=(const LibusbPort&) = delete;

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }

  Result<std::vector<std::byte>> configuration() override {
    constexpr ControlRequest kGetConfiguration{
        .type = LIBUSB_ENDPOINT_IN, .request = LIBUSB_REQUEST_GET_DESCRIPTOR, .value = 0x0200};
    constexpr std::size_t kLongest = 65535;
    std::vector<std::byte> bytes(kLongest);
    return control_in(kGetConfiguration, bytes).map([&](std::size_t size) {
      bytes.resize(size);
      return std::move(bytes);
    });
  }

  Result<void> claim(std::uint8_t interface) override {
    if (const int code = libusb_claim_interface(handle_.get(), interface); code != 0) {
      return usb_error(fmt::format("interface {} cannot be claimed", interface), code);
    }
    claimed_.push_back(interface);
    return {};
  }

  Result<std::size_t> control_in(const ControlRequest& request,
                                 std::span<std::byte> data) override {
    const int size = transfer(request, data.data(), data.size());
    if (size < 0) {
      return usb_error("a control transfer failed", size);
    }
    return static_cast<std::size_t>(size);
  }

  Result<void> control_out(const ControlRequest& request,
                           std::span<const std::byte> data) override {
    std::vector<std::byte> copy{data.begin(), data.end()};  // libusb wants it writable
    const int size = transfer(request, copy.data(), copy.size());
    if (size < 0) {
      return usb_error("a control transfer failed", size);
    }
    return {};
  }

  Result<void> clear_halt(std::uint8_t endpoint) override {
    if (const int code = libusb_clear_halt(handle_.get(), endpoint); code != 0) {
      return usb_error("a halt cannot be cleared", code);
    }
    return {};
  }

  Result<void> start_in(const InPipe& pipe) override {
    stop_in(pipe.endpoint);
    auto reader = std::make_unique<Reader>(Reader{.endpoint = pipe.endpoint});
    for (int i = 0; i < pipe.transfers; ++i) {
      auto slot = std::make_unique<Slot>(*this, *reader, pipe.transfer_bytes);
      libusb_transfer* raw = slot->transfer.get();
      if (raw == nullptr) {
        return fail(ErrorCode::kUnavailable, "no memory for USB transfers");
      }
      libusb_fill_bulk_transfer(raw, handle_.get(), pipe.endpoint, slot->buffer.data(),
                                static_cast<int>(slot->buffer.size()), &on_done, slot.get(), 0);
      raw->type = pipe.interrupt ? LIBUSB_TRANSFER_TYPE_INTERRUPT : LIBUSB_TRANSFER_TYPE_BULK;
      reader->slots.push_back(std::move(slot));
    }
    pipes_.push_back(std::move(reader));
    for (const auto& slot : pipes_.back()->slots) {
      if (const int code = submit(*slot); code != 0) {
        stop_in(pipe.endpoint);
        return usb_error("a USB transfer cannot be started", code);
      }
    }
    return {};
  }

  void stop_in(std::uint8_t endpoint) override {
    const auto found =
        std::ranges::find(pipes_, endpoint, [](const auto& pipe) { return pipe->endpoint; });
    if (found == pipes_.end()) {
      return;
    }
    Reader& reader = **found;
    reader.stopping = true;
    for (const auto& slot : reader.slots) {
      if (slot->pending) {
        libusb_cancel_transfer(slot->transfer.get());
      }
    }
    const HostTime limit = HostClock::now() + kCancelTimeout;
    const auto pending = [&] { return std::ranges::any_of(reader.slots, &Slot::pending); };
    while (pending() && HostClock::now() < limit) {
      (void)handle_events(std::chrono::milliseconds{10});
    }
    if (pending()) {
      // The kernel still has these buffers; to leave them is the lesser evil.
      log::error("usb", "transfers of endpoint {:#04x} could not be cancelled", endpoint);
      (void)found->release();
    }
    pipes_.erase(found);
  }

  Result<void> poll(Duration timeout, InSink& sink) override {
    sink_ = &sink;
    const int code = handle_events(timeout);
    sink_ = nullptr;
    if (gone_) {
      return fail(ErrorCode::kNotFound, "the USB device at {} is gone", info_.place);
    }
    if (code != 0 && code != LIBUSB_ERROR_INTERRUPTED) {
      return usb_error("USB's events cannot be handled", code);
    }
    return {};
  }

  Result<void> reset() override {
    while (!pipes_.empty()) {
      stop_in(pipes_.back()->endpoint);
    }
    if (const int code = libusb_reset_device(handle_.get()); code != 0) {
      return usb_error("the USB device cannot be reset", code);
    }
    return {};
  }

 private:
  struct Reader;
  /// One transfer with its memory.
  struct Slot {
    Slot(LibusbPort& its_port, Reader& its_reader, std::size_t bytes)
        : port{its_port}, reader{its_reader}, buffer(bytes) {}
    LibusbPort& port;
    Reader& reader;
    TransferPtr transfer{libusb_alloc_transfer(0), &libusb_free_transfer};
    std::vector<unsigned char> buffer;
    bool pending = false;
  };
  struct Reader {
    std::uint8_t endpoint = 0;
    bool stopping = false;
    std::vector<std::unique_ptr<Slot>> slots{};
  };

  int transfer(const ControlRequest& request, std::byte* data, std::size_t size) {
    void* const bytes = data;
    const int done = libusb_control_transfer(
        handle_.get(), request.type, request.request, request.value, request.index,
        static_cast<unsigned char*>(bytes), static_cast<std::uint16_t>(size), kControlTimeout_ms);
    gone_ = gone_ || done == LIBUSB_ERROR_NO_DEVICE;
    return done;
  }

  int handle_events(Duration timeout) {
    using std::chrono::microseconds;
    using std::chrono::seconds;
    const auto whole = std::chrono::duration_cast<seconds>(timeout);
    timeval limit{.tv_sec = whole.count(),
                  .tv_usec = std::chrono::duration_cast<microseconds>(timeout - whole).count()};
    return libusb_handle_events_timeout_completed(context_.get(), &limit, nullptr);
  }

  static int submit(Slot& slot) {
    const int code = libusb_submit_transfer(slot.transfer.get());
    slot.pending = code == 0;
    slot.port.gone_ = slot.port.gone_ || code == LIBUSB_ERROR_NO_DEVICE;
    return code;
  }

  /// Called by libusb inside handle_events().
  static void LIBUSB_CALL on_done(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.pending = false;
    slot.port.finish(slot);
  }

  void finish(Slot& slot) {
    const libusb_transfer& transfer = *slot.transfer;
    const auto status = transfer.status;
    if (slot.reader.stopping || status == LIBUSB_TRANSFER_CANCELLED) {
      return;
    }
    if (status == LIBUSB_TRANSFER_NO_DEVICE) {
      gone_ = true;
      return;
    }
    TransferStatus told = TransferStatus::kFailed;
    if (status == LIBUSB_TRANSFER_COMPLETED) {
      told = TransferStatus::kCompleted;
    } else if (status == LIBUSB_TRANSFER_STALL) {
      told = TransferStatus::kStalled;
    }
    if (sink_ != nullptr) {
      const auto data = std::as_bytes(std::span{slot.buffer})
                            .first(static_cast<std::size_t>(std::max(transfer.actual_length, 0)));
      sink_->on_transfer(slot.reader.endpoint, told, data, HostClock::now());
    }
    if (told != TransferStatus::kStalled) {
      (void)submit(slot);  // a device that is gone is noticed by it
    }
  }

  ContextPtr context_;
  DeviceInfo info_;
  HandlePtr handle_;
  std::vector<std::uint8_t> claimed_;
  std::vector<std::unique_ptr<Reader>> pipes_;
  InSink* sink_ = nullptr;
  bool gone_ = false;
};

}  // namespace

Result<std::vector<DeviceInfo>> list_devices(std::uint16_t vendor, std::uint16_t product) {
  auto context = make_context();
  if (!context) {
    return tl::unexpected{std::move(context.error())};
  }
  return find(context->get(), vendor, product).map([](const std::vector<Found>& found) {
    std::vector<DeviceInfo> infos;
    for (const Found& one : found) {
      infos.push_back(one.info);
    }
    return infos;
  });
}

Result<std::unique_ptr<Port>> open_device(std::uint16_t vendor, std::uint16_t product,
                                          const std::string& serial) {
  auto context = make_context();
  if (!context) {
    return tl::unexpected{std::move(context.error())};
  }
  auto found = find(context->get(), vendor, product);
  if (!found) {
    return tl::unexpected{std::move(found.error())};
  }
  for (Found& one : *found) {
    if (!one.handle) {
      return fail(ErrorCode::kSystem,
                  "the USB device {:04x}:{:04x} at {} cannot be opened: {}; udev/60-geoflow.rules "
                  "gives access to it",
                  vendor, product, one.info.place, libusb_strerror(one.open_code));
    }
    if (serial.empty() || serial == one.info.serial) {
      return std::make_unique<LibusbPort>(std::move(*context), std::move(one));
    }
  }
  return fail(ErrorCode::kNotFound, "no USB device {:04x}:{:04x}{}{} is connected", vendor, product,
              serial.empty() ? "" : " with the serial number ", serial);
}

}  // namespace geoflow::drivers::usb
