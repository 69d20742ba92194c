#include "emulate/sent_log.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/checksum.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::tools {
namespace {

constexpr std::uint8_t kFirstInterrupt = 0x85;

std::string hexadecimal(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    text += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
  }
  return text;
}

}  // namespace

Result<std::unique_ptr<SentLog>> SentLog::open(emulator::UsbDevice& device,
                                               const std::filesystem::path& path) {
  std::ofstream file{path};
  if (!file) {
    return fail_errno(path.string());
  }
  return std::unique_ptr<SentLog>{new SentLog{device, std::move(file)}};
}

emulator::InTransfer SentLog::next_in(std::uint8_t endpoint, HostTime now) {
  emulator::InTransfer transfer = device_.next_in(endpoint, now);
  if (transfer.status == emulator::InStatus::kData) {
    const std::span<const std::byte> data{transfer.data};
    nlohmann::json line{
        {"endpoint", endpoint}, {"size", data.size()}, {"t_ns", now.time_since_epoch().count()}};
    if (endpoint >= kFirstInterrupt) {
      line["report"] = hexadecimal(data);
    } else {
      const std::size_t header =
          data.empty() ? 0 : std::min(std::to_integer<std::size_t>(data.front()), data.size());
      line["header"] = hexadecimal(data.first(header));
      line["crc32"] = emulator::crc32(data.subspan(header));
    }
    file_ << line.dump() << '\n' << std::flush;
  }
  return transfer;
}

}  // namespace geoflow::tools
