#include "berth/operate/events.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "berth/can/empty_bus.hpp"

namespace berth::operate {

Events::Events(const rt::Executor& executor, std::string bus, NetworkObserver observer)
    : executor_(executor), bus_(std::move(bus)), observer_(std::move(observer)) {}

void Events::tell(EventKind kind, std::string slot, std::string text) {
  if (observer_.event) observer_.event({executor_.now(), bus_, kind, std::move(slot), std::move(text)});
}

void Events::tell_once(EventKind kind, const std::string& text) {
  tell_once(Event{executor_.now(), bus_, kind, {}, text});
}

void Events::tell_once(const Event& event) {
  if (std::ranges::find(told_, event.text) != told_.end()) return;
  told_.push_back(event.text);
  if (observer_.event) observer_.event(event);
}

void Events::tell_failure(const std::string& what, const Error& error) {
  const bool alone = error.code == Errc::bus && std::string_view(error.text) == can::no_acknowledge;
  tell_once(EventKind::error, alone ? error.text : what + ": " + describe(error));
}

void Events::reach(Milestone milestone) {
  auto& reached = reached_[static_cast<std::size_t>(milestone)];
  if (reached) return;
  reached = true;
  tell(EventKind::milestone, "", name(milestone));
  if (observer_.milestone) observer_.milestone(milestone);
}

}  // namespace berth::operate
