#include "berth/discovery/discovery.hpp"

#include <algorithm>
#include <array>

namespace berth::discovery {
namespace {
constexpr std::array<std::string_view, methods> names{
    "rand",     "and",          "fastscan",         "fastscan-feedback-29", "fastscan-feedback-11",
    "identify", "planner-rand", "planner-fastscan", "planner-feedback"};
}  // namespace

std::string_view name(Method method) noexcept { return names[static_cast<std::size_t>(method)]; }

Result<Method> method(std::string_view name) noexcept {
  const auto it = std::ranges::find(names, name);
  if (it == names.end()) return fail(Errc::not_found, "no discovery method of this name");
  return static_cast<Method>(it - names.begin());
}

const char* name(Report::End end) noexcept {
  switch (end) {
    case Report::End::complete: return "complete";
    case Report::End::gave_up: return "gave up";
    case Report::End::stuck: return "stuck";
    case Report::End::limit: return "limit";
    case Report::End::more: return "more";
    case Report::End::held: return "held";
  }
  return "?";
}

}  // namespace berth::discovery
