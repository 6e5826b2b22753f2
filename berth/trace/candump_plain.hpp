/// The output of can-utils' `candump` without -L: fields in columns, the time in one of its forms or left out.
///
///       can0  7E5   [8]  04 01 00 00 00 00 00 00
///      (1436509052.249713)  can0  1F900135   [0]
///      (2015-07-10 14:24:12.249713)  can0  RX - -  701   [0]  remote request
///       can0  123  [12]  00 11 22 33 44 55 66 77 88 99 AA BB      FD
///       can0  20000004   [8]  00 08 00 00 00 00 00 00   ERRORFRAME
///       can0  123   {F}  00 11 22 33 44 55 66 77             -8: a DLC above 8
///
/// Times have any number of digits after the point (-N: nine). candump -a's text after the data is ignored. The FD
/// flags BRS and ESI are not in it (-x has them).
#pragma once

#include <optional>
#include <string_view>

#include "berth/trace/trace.hpp"

namespace berth::trace {

struct PlainLine {
  rt::Duration at{};     ///< by date: since 1970, as if the date were UTC
  bool timed = false;    ///< else `at` is 0
  std::string_view bus;  ///< points into the line
  can::Frame frame;
  Direction direction = Direction::unknown;
  bool error = false;  ///< an error frame of SocketCAN
};

/// Nothing for a line that candump does not print.
[[nodiscard]] std::optional<PlainLine> parse_plain_candump(std::string_view line);

}  // namespace berth::trace
