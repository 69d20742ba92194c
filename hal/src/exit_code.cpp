#include "geoflow/hal/exit_code.hpp"

#include "geoflow/hal/result.hpp"

namespace geoflow {

ExitCode exit_code(const Error& error) noexcept {
  switch (error.code) {
    case ErrorCode::kInvalidArgument:
      return ExitCode::kUsage;
    case ErrorCode::kNotFound:
    case ErrorCode::kInvalidData:
    case ErrorCode::kUnsupported:
      return ExitCode::kBadInput;
    case ErrorCode::kUnavailable:
      return ExitCode::kUnavailable;
    case ErrorCode::kSystem:
      break;
  }
  return ExitCode::kFailure;
}

const char* error_name(ErrorCode code) noexcept {
  switch (code) {
    case ErrorCode::kNotFound:
      return "not_found";
    case ErrorCode::kInvalidData:
      return "invalid_data";
    case ErrorCode::kInvalidArgument:
      return "invalid_argument";
    case ErrorCode::kUnsupported:
      return "unsupported";
    case ErrorCode::kUnavailable:
      return "unavailable";
    case ErrorCode::kSystem:
      break;
  }
  return "system";
}

}  // namespace geoflow
