#include "map/map_files.hpp"

#include <filesystem>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

namespace geoflow::daemon {
namespace {

namespace fs = std::filesystem;

fs::path with_ending(fs::path file, std::string_view ending) {
  return file += ending;
}

Result<void> move(const fs::path& from, const fs::path& to) {
  std::error_code failure;
  fs::rename(from, to, failure);
  return !failure ? Result<void>{}
                  : fail(ErrorCode::kSystem, "{}: cannot be renamed to {}: {}", from.string(),
                         to.string(), failure.message());
}

}  // namespace

Result<std::shared_ptr<const slam::StoredMap>> load_own_map(const fs::path& file,
                                                            const Calibration& calibration) {
  return slam::load_map(file).and_then([&](auto map) {
    return slam::made_with(*map, calibration).map([&] { return map; }).map_error([&](Error error) {
      return std::move(error).in(file.string());
    });
  });
}

Result<fs::path> move_aside(const fs::path& file) {
  std::error_code failure;
  if (file.empty() || !fs::exists(file, failure)) {
    return fs::path{};
  }
  fs::path aside = with_ending(file, ".old");
  return move(file, aside).map([&] { return std::move(aside); });
}

Result<fs::path> replace_map(const fs::path& file, const slam::StoredMap& next,
                             const slam::StoredMap* former) {
  fs::path aside = with_ending(file, ".old");
  // First, since `next` may be what is kept aside.
  const fs::path fresh = with_ending(file, ".new");
  auto moved = slam::save_map(next, fresh).and_then([&]() -> Result<fs::path> {
    return former == nullptr ? move_aside(file)
                             : slam::save_map(*former, aside).map([&] { return std::move(aside); });
  });
  if (!moved) {
    std::error_code none;
    fs::remove(fresh, none);
    return moved;
  }
  return move(fresh, file).map([&] { return *moved; });
}

}  // namespace geoflow::daemon
