// Stands in for camera.cpp where OpenNI2 is not installed.
#include <memory>

#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/drivers/openni2_camera.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers {

Result<std::unique_ptr<LiveCamera>> open_openni2_camera(const OpenNi2Options& /*options*/) {
  return fail(ErrorCode::kUnsupported,
              "this program was built without OpenNI2 (libopenni2-dev was not installed)");
}

}  // namespace geoflow::drivers
