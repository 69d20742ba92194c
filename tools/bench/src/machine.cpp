#include <cstddef>
#include <fstream>
#include <string>

#include <fmt/core.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {
namespace {

std::string cpu_name() {
  std::ifstream stream{"/proc/cpuinfo"};
  std::string line;
  while (std::getline(stream, line)) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

}  // namespace

Machine this_machine() {
  utsname names{};
  const bool named = ::uname(&names) == 0;
  return {.cpu = cpu_name(),
          .cores = static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN)),
          .kernel = named ? fmt::format("{} {}", &names.sysname[0], &names.release[0]) : "unknown",
#ifdef __clang__
          .compiler = "Clang " __clang_version__};
#else
          .compiler = "GCC " __VERSION__};
#endif
}

}  // namespace geoflow::tools
