/// Dates and decimal seconds in logs. Everything is UTC. Inside of room `trace`.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "berth/rt/executor.hpp"

namespace berth::trace {

/// " Fri Jul 10 06:17:32.249 2015", "Sam Sep 30 03:06:13 pm 2017": weekday (ignored, may be missing), English or German
/// month, day, time, am or pm, year from 1970 to 2255. Since 1970.
[[nodiscard]] std::optional<rt::Duration> parse_date(std::string_view text);
/// "Fri Jul 10 06:17:32.249 2015"; milliseconds are cut.
[[nodiscard]] std::string write_date(rt::Duration since_1970);

/// "0.001900", "12": seconds; digits after the ninth decimal are dropped. Empty: no such number, or too large.
[[nodiscard]] std::optional<rt::Duration> parse_seconds(std::string_view text) noexcept;
/// The same in milliseconds, to the nanosecond.
[[nodiscard]] std::optional<rt::Duration> parse_milliseconds(std::string_view text) noexcept;

/// OLE automation date: days since 30 December 1899, "43474.57245773", to 2255. Rounded to microseconds. Since 1970.
[[nodiscard]] std::optional<rt::Duration> parse_ole_date(std::string_view text) noexcept;
/// With 14 decimals, so that reading it gives the same microsecond.
[[nodiscard]] std::string write_ole_date(rt::Duration since_1970);

}  // namespace berth::trace
