/// The log format of can-utils' `candump -L`, which `canplayer` plays: one frame a line, bytes in and bytes out.
///
///     (1436509052.249713) can0 7E5#5100000000800000        base, data
///     (1436509052.250001) can0 1F900135#                   extended, no data
///     (1436509052.250400) can0 701#R                       remote
///     (1436509052.250900) can0 123##1AABB                  FD, flags 1 = BRS, 2 = ESI
///
/// Time is seconds and six digits of microseconds; the bus's name has no blanks; the frame is as `can::to_string`
/// writes it. A direction behind it (` R`, ` T`: `candump -x`) is read and forgotten.
#pragma once

#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/trace/trace.hpp"

namespace berth::trace {

struct Reading {
  Trace trace;        ///< every line that could be read, errors or not
  Findings findings;  ///< with line and column; errors: lines that are not of this format
};

/// Reads a whole log. Strict: anything that candump does not write is an error, and its line is left out. Empty lines
/// and either kind of line end pass. Warnings: time goes backwards on a bus; SocketCAN's error frames (identifier with
/// 2000 0000h), which are no frames and are left out. After `most_findings` the rest is counted in one last finding.
[[nodiscard]] Reading read_candump(std::string_view text, const std::string& file_name);
inline constexpr std::size_t most_findings = 100;

/// One line without its end. `at` 0 or later, rounded to the nearest microsecond. `bus` is written as it is.
[[nodiscard]] std::string candump_line(rt::Duration at, std::string_view bus, const can::Frame& frame);
/// The same for a frame that is text already, as `can::to_string` writes it.
[[nodiscard]] std::string candump_line(rt::Duration at, std::string_view bus, std::string_view frame);
/// The whole log, each line with its end.
[[nodiscard]] std::string write_candump(const Trace& trace);

}  // namespace berth::trace
