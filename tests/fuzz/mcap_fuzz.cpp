#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>

#include <unistd.h>

#include "replay/bag/bag.hpp"
#include "replay/bag/mcap_format.hpp"
#include "replay/bag/reader.hpp"

// Any bytes behind the magic of an MCAP file: read to the end, or refused.

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace geoflow::drivers;  // NOLINT(google-build-using-namespace): a program of its own
  static const std::filesystem::path scratch =
      std::filesystem::temp_directory_path() /
      ("mcap_fuzz_" + std::to_string(::getpid()) + ".mcap");
  std::ofstream{scratch, std::ios::binary} << bag::mcap::kMagic << std::string{data, data + size};
  if (const auto opened = bag::Bag::open(scratch)) {
    (*opened)->select([](std::string_view) { return true; });
    for (auto message = (*opened)->next(); !message || *message; message = (*opened)->next()) {
    }
  }
  if (auto reader = bag::open(scratch, {})) {
    for (auto event = (*reader)->next(); !event || *event; event = (*reader)->next()) {
    }
  }
  return 0;
}
