#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>

#include <unistd.h>

#include "replay/bag/bag.hpp"
#include "replay/bag/metadata.hpp"
#include "replay/bag/reader.hpp"

// Any bytes as a database file of a bag (plain or compressed) and as metadata.yaml: read to the
// end, or refused.

namespace {

using namespace geoflow::drivers;  // NOLINT(google-build-using-namespace): a program of its own

std::filesystem::path scratch_file() {
  return std::filesystem::temp_directory_path() /
         ("bag_fuzz_" + std::to_string(::getpid()) + ".db3");
}

void read_everything(const std::filesystem::path& path) {
  const auto bag = bag::Bag::open(path);
  if (!bag) {
    return;
  }
  (*bag)->select([](std::string_view) { return true; });
  while (true) {
    const auto message = (*bag)->next();
    if (message && !*message) {
      return;
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path scratch = scratch_file();
  const std::string bytes{data, data + size};
  std::ofstream{scratch, std::ios::binary} << bytes;
  read_everything(scratch);
  if (auto reader = bag::open(scratch, {})) {
    for (auto event = (*reader)->next(); !event || *event; event = (*reader)->next()) {
    }
  }
  (void)bag::parse_metadata(bytes, "metadata.yaml");
  return 0;
}
