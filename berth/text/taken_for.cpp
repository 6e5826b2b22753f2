#include "berth/text/taken_for.hpp"

#include <fmt/format.h>

namespace berth::text {
namespace {

/// True: a line begins with `start`, after blanks.
bool has_line(std::string_view text, std::string_view start) noexcept {
  while (!text.empty()) {
    const auto end = text.find('\n');
    const auto line = text.substr(0, end);
    const auto first = line.find_first_not_of(" \t");
    if (first != std::string_view::npos && line.substr(first).starts_with(start)) return true;
    if (end == std::string_view::npos) return false;
    text.remove_prefix(end + 1);
  }
  return false;
}

bool is_description(std::string_view text) noexcept {
  return has_line(text, "<?xml") || has_line(text, "<ISO15745") ||
         (has_line(text, "[FileInfo]") && has_line(text, "[DeviceInfo]"));
}

}  // namespace

std::optional<Finding> taken_for(FileKind wanted, std::string_view text, const std::string& file) {
  const auto is = [&](std::string what, std::string then) {
    return Finding{Finding::Severity::error, file, 0, 0, {}, "this is " + std::move(what), std::move(then)};
  };
  if (is_description(text)) {
    return is("a device description (EDS, DCF or XDD)",
              fmt::format("`berth init --eds {}` makes a machine file and a plant file of it", file));
  }
  const bool of_machine = has_line(text, "[machine]") || has_line(text, "[[slot]]");
  const bool of_plant = has_line(text, "[plant]") || has_line(text, "[[device]]");
  if (wanted == FileKind::machine && of_plant && !of_machine) {
    return is("a plant file, the devices of a simulated machine",
              fmt::format("name the machine file: `berth up MACHINE --sim {}`", file));
  }
  if (wanted == FileKind::plant && of_machine && !of_plant) {
    return is("a machine file", "name the plant file that has its [[device]] tables; `berth init` writes one");
  }
  return std::nullopt;
}

}  // namespace berth::text
