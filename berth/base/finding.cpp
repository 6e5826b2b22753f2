#include "berth/base/finding.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth {

std::string to_string(const Finding& f) {
  static constexpr const char* names[] = {"note", "warning", "error"};
  std::string out = f.file;
  if (f.line > 0) out += fmt::format(":{}", f.line);
  if (f.line > 0 && f.column > 0) out += fmt::format(":{}", f.column);
  out += fmt::format(": {}: ", names[static_cast<int>(f.severity)]);
  if (!f.key.empty()) out += f.key + ": ";
  out += f.message;
  if (!f.fix.empty()) out += "; " + f.fix;
  return out;
}

bool has_errors(const Findings& findings) noexcept {
  return std::ranges::any_of(findings, [](const Finding& f) { return f.severity == Finding::Severity::error; });
}

}  // namespace berth
