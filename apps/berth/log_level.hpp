/// How urgent an event is, in the words of syslog(3): for logs, and for the filter of `berth up --log-level`.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "berth/operate/report.hpp"

namespace berth::cli {

/// The values are syslog's.
enum class LogLevel : std::uint8_t {
  error = 3,    ///< the bus or a file failed; two devices hold one node-ID
  warning = 4,  ///< a person has something to do, or a device reported an error
  notice = 5,   ///< what a machine that starts or changes goes through
  info = 6,     ///< single steps of slots, and devices that are found
  debug = 7,    ///< the step under way
};
inline constexpr std::array<std::string_view, 5> log_levels{"error", "warning", "notice", "info", "debug"};

[[nodiscard]] LogLevel level_of(const operate::Event& event) noexcept;
/// One of `log_levels`.
[[nodiscard]] LogLevel log_level(std::string_view word) noexcept;
/// As sd-daemon(3) has it: "<4>".
[[nodiscard]] std::string prefix_of(LogLevel level);

}  // namespace berth::cli
