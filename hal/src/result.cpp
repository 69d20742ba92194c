#include "geoflow/hal/result.hpp"

#include <cerrno>
#include <string_view>
#include <system_error>

#include <tl/expected.hpp>

namespace geoflow {

tl::unexpected<Error> fail_errno(std::string_view what) {
  const int code = errno;
  return fail(code == ENOENT ? ErrorCode::kNotFound : ErrorCode::kSystem, "{}: {}", what,
              std::generic_category().message(code));
}

}  // namespace geoflow
