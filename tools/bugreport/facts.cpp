#include "bugreport/facts.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <sys/utsname.h>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/tools/daemon_text.hpp"

#include "bugreport/archive.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kLogBytes = std::size_t{256} << 10U;

/// The lines of a file that begin with one of these words; all where none is given.
std::string lines_of(const std::filesystem::path& file, const std::vector<std::string>& words) {
  std::ifstream stream{file};
  std::string text;
  for (std::string line; std::getline(stream, line);) {
    const bool wanted = words.empty() || std::ranges::any_of(words, [&](const std::string& word) {
                          return line.starts_with(word);
                        });
    if (wanted) {
      text += line + "\n";
    }
  }
  return text;
}

std::string first_line(const std::filesystem::path& file) {
  std::ifstream stream{file};
  std::string line;
  std::getline(stream, line);
  return line;
}

std::vector<std::filesystem::path> entries(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> found;
  std::error_code failure;
  std::filesystem::directory_iterator entry{folder, failure};
  for (; !failure && entry != std::filesystem::directory_iterator{}; entry.increment(failure)) {
    found.push_back(entry->path());
  }
  std::ranges::sort(found);
  return found;
}

std::string usb_devices() {
  std::string text;
  for (const std::filesystem::path& device : entries("/sys/bus/usb/devices")) {
    if (const std::string vendor = first_line(device / "idVendor"); !vendor.empty()) {
      text += fmt::format("usb {}: {}:{} {} {}, {} Mbit/s\n", device.filename().string(), vendor,
                          first_line(device / "idProduct"), first_line(device / "manufacturer"),
                          first_line(device / "product"), first_line(device / "speed"));
    }
  }
  return text;
}

std::string network_devices() {
  std::string text;
  for (const std::filesystem::path& device : entries("/sys/class/net")) {
    text += fmt::format("network {}: {}\n", device.filename().string(),
                        first_line(device / "operstate"));
  }
  return text;
}

std::string end_of_file(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary | std::ios::ate};
  const std::streamoff size = stream.tellg();
  const std::streamoff begin = std::max<std::streamoff>(size - std::streamoff{kLogBytes}, 0);
  std::string text(static_cast<std::size_t>(std::max<std::streamoff>(size - begin, 0)), '\0');
  stream.seekg(begin);
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
  return text;
}

}  // namespace

std::string machine_facts() {
  utsname kernel{};
  ::uname(&kernel);
  return fmt::format("kernel {} {} {}\n", &kernel.sysname[0], &kernel.release[0],
                     &kernel.machine[0]) +
         lines_of("/etc/os-release", {"PRETTY_NAME", "VERSION_ID"}) +
         lines_of("/proc/meminfo", {"MemTotal", "MemAvailable", "SwapTotal"}) +
         "uptime and idle time [s] " + first_line("/proc/uptime") + "\nload " +
         first_line("/proc/loadavg") + "\n" +
         lines_of("/proc/cpuinfo", {"processor", "model name", "Model", "Hardware"});
}

std::string device_facts() {
  std::string text;
  for (const drivers::D435iFinding& finding : drivers::diagnose_d435i()) {
    constexpr std::array<std::string_view, 3> kGrades = {"good", "note", "problem"};
    text +=
        fmt::format("{}: {}\n", kGrades.at(static_cast<std::size_t>(finding.grade)), finding.what);
    text += finding.remedy.empty() ? "" : "    " + finding.remedy + "\n";
  }
  return text + usb_devices() + network_devices();
}

std::string last_log(const nlohmann::json& status) {
  const auto pid = static_cast<long>(number_at(status, "pid"));
  if (pid > 0) {
    std::error_code failure;
    const std::filesystem::path target =
        std::filesystem::read_symlink(fmt::format("/proc/{}/fd/2", pid), failure);
    if (!failure && std::filesystem::is_regular_file(target, failure)) {
      return end_of_file(target);
    }
  }
  const auto journal = output_of(
      {"journalctl", "--unit=geoflow", "--lines=2000", "--no-pager", "--output=short-iso"},
      kLogBytes);
  return journal ? *journal : "there is no log: " + journal.error().message + "\n";
}

}  // namespace geoflow::tools
