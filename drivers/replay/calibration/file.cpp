#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "replay/calibration/kalibr.hpp"
#include "replay/calibration/writer.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers {
namespace {

constexpr std::array<std::string_view, 2> kChainFiles = {"camchain-imucam.yaml", "camchain.yaml"};
constexpr std::string_view kImuFile = "imu.yaml";
constexpr std::size_t kLargestFile = std::size_t{1} << 20U;

std::optional<std::filesystem::path> chain_in(const std::filesystem::path& directory) {
  for (const std::string_view name : kChainFiles) {
    std::error_code error;
    if (std::filesystem::is_regular_file(directory / name, error)) {
      return directory / name;
    }
  }
  return std::nullopt;
}

Result<void> write_all(const UniqueFd& file, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(file.get(), content.data(), content.size());
    if (written < 0 && errno == EINTR) {
      continue;
    }
    if (written <= 0) {
      return fail_errno("write");
    }
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  return ::fsync(file.get()) == 0 ? Result<void>{} : fail_errno("fsync");
}

/// By way of a temporary file beside it, so that a reader sees the old or the new content.
Result<void> replace_file(const std::filesystem::path& path, std::string_view content) {
  std::string temporary = path.string() + ".XXXXXX";
  constexpr ::mode_t kReadable = 0644;
  const UniqueFd file{::mkostemp(temporary.data(), O_CLOEXEC)};
  if (!file) {
    return fail_errno(path.string());
  }
  auto written = write_all(file, content);
  if (written &&
      (::fchmod(file.get(), kReadable) != 0 || std::rename(temporary.c_str(), path.c_str()) != 0)) {
    written = fail_errno("rename");
  }
  if (!written) {
    ::unlink(temporary.c_str());
    return tl::unexpected{std::move(written.error()).in(path.string())};
  }
  return {};
}

}  // namespace

bool has_calibration(const std::filesystem::path& directory) {
  return chain_in(directory).has_value();
}

Result<Calibration> load_calibration(const std::filesystem::path& directory) {
  const auto chain = chain_in(directory);
  if (!chain) {
    return fail(ErrorCode::kNotFound, "{}: neither {} nor {}", directory.string(), kChainFiles[0],
                kChainFiles[1]);
  }
  auto calibration = text::read_file(*chain, kLargestFile).and_then([&](std::string content) {
    return kalibr::parse_camchain(chain->string(), std::move(content));
  });
  const auto imu = directory / kImuFile;
  std::error_code error;
  if (!calibration || !std::filesystem::exists(imu, error)) {
    return calibration;
  }
  auto noise = text::read_file(imu, kLargestFile).and_then([&](std::string content) {
    return kalibr::parse_imu(imu.string(), std::move(content));
  });
  if (!noise) {
    return tl::unexpected{std::move(noise.error())};
  }
  calibration->imu_noise = *noise;
  return calibration;
}

Result<void> save_calibration(const Calibration& calibration,
                              const std::filesystem::path& directory) {
  auto saved = replace_file(directory / kChainFiles[0], kalibr::write_camchain(calibration));
  return saved ? replace_file(directory / kImuFile, kalibr::write_imu(calibration.imu_noise))
               : saved;
}

}  // namespace geoflow::drivers
