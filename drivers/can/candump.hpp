#pragma once

#include <string>
#include <string_view>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"

/// The log format of can-utils (`candump -L`, read by `canplayer`), one frame a line:
///
///     (1436509052.249713) can0 110#0CFE9411D8DC0701        classic; 8 digits: 29-bit identifier
///     (1436509052.249713) can0 210##1000000002CCF00006A18  FD; the digit after ## are its flags
///     (1436509052.249713) can0 123#R                       remote request
///     (1436509052.249713) can0 20000040#0000000000000000   error report
namespace geoflow::drivers::can {

/// One line of a log.
struct LogLine {
  Duration stamp{};            ///< as written, seconds of any clock
  std::string_view interface;  ///< a view of the line
  Frame frame;
};

/// Reads a line. The error says what is wrong with it, not where it stands. Pure.
[[nodiscard]] Result<LogLine> parse_log_line(std::string_view line);

/// Writes a line, without its end; microseconds as candump does. Pure.
[[nodiscard]] std::string format_log_line(Duration stamp, std::string_view interface,
                                          const Frame& frame);

}  // namespace geoflow::drivers::can
