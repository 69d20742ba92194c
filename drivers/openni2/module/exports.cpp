// The functions by which OpenNI finds the driver.
#include <memory>

#include <Driver/OniDriverAPI.h>

#include "openni2/module/driver.hpp"

// What OpenNI's macro wants of PrimeSense's support library, which Debian does not ship.
// NOLINTBEGIN(cppcoreguidelines-macro-usage,misc-use-internal-linkage,cppcoreguidelines-avoid-non-const-global-variables):
// the macro's form
#define XN_NEW(type, argument) std::make_unique<type>(argument).release()
#define XN_DELETE(pointer) std::unique_ptr<oni::driver::DriverBase>(pointer).reset()
ONI_EXPORT_DRIVER(geoflow::drivers::openni2::Driver)
// NOLINTEND(cppcoreguidelines-macro-usage,misc-use-internal-linkage,cppcoreguidelines-avoid-non-const-global-variables)
