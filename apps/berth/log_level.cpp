#include "log_level.hpp"

#include <algorithm>

namespace berth::cli {
namespace {

LogLevel level_of(operate::EventKind kind) noexcept {
  using Kind = operate::EventKind;
  switch (kind) {
    case Kind::error:
    case Kind::duplicate: return LogLevel::error;
    case Kind::question:
    case Kind::power_cycle_needed:
    case Kind::emcy:
    case Kind::surplus:
    case Kind::foreign:
    case Kind::clone:
    case Kind::wrong_revision:
    case Kind::fixed_mismatch:
    case Kind::misplaced:
    case Kind::returned:
    case Kind::unfinished: return LogLevel::warning;
    case Kind::bound:
    case Kind::new_device:
    case Kind::moved:
    case Kind::configured:
    case Kind::restored:
    case Kind::forgotten:
    case Kind::recipe:
    case Kind::startup:
    case Kind::master:
    case Kind::milestone: return LogLevel::notice;
    case Kind::state:
    case Kind::found:
    case Kind::lent: return LogLevel::info;
    case Kind::step: break;
  }
  return LogLevel::debug;
}

}  // namespace

// A state is a person's business if it is none on the way to operational.
LogLevel level_of(const operate::Event& event) noexcept {
  const auto begins = [&](places::SlotState state) { return event.text.starts_with(places::name(state)); };
  const bool fails = event.kind == operate::EventKind::state &&
                     (begins(places::SlotState::failed) || begins(places::SlotState::absent));
  return fails ? LogLevel::warning : level_of(event.kind);
}

LogLevel log_level(std::string_view word) noexcept {
  const auto it = std::ranges::find(log_levels, word);
  const auto place = it == log_levels.end() ? std::ptrdiff_t{4} : it - log_levels.begin();
  return static_cast<LogLevel>(static_cast<int>(LogLevel::error) + place);
}

std::string prefix_of(LogLevel level) { return {'<', static_cast<char>('0' + static_cast<int>(level)), '>'}; }

}  // namespace berth::cli
