#include "first_saves.hpp"

#include <algorithm>

#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"

namespace berth::cli {

namespace {

rt::Task<void> save_and_reset(tree::Session& session, std::string bus, std::string slot, FirstSaves::Say say) {
  const command::Request store{"store", {{"bus", bus}, {"node", slot}}};
  command::Reply reply;
  co_await command::execute(session, store, reply);
  if (reply.status != 0) {
    say(reply.error);
    co_return;
  }
  const command::Request reset{"nmt", {{"bus", bus}, {"command", "reset-node"}, {"node", slot}, {"no-wait", "1"}}};
  co_await command::execute(session, reset, reply);
  say(reply.status == 0 ? slot + ": its parameters are saved, and it was reset; if its program ended, start it again"
                        : reply.error);
}

}  // namespace

void FirstSaves::event(const operate::Event& event) {
  if (!event.offers_save || event.slots.empty()) return;
  const Slot slot{event.bus, event.slots.front()};
  if (yes_) return save(slot);
  say_("type: save " + slot.name);
  open_.push_back(slot);
}

bool FirstSaves::take(const std::string& line) {
  const auto end = line.find_last_not_of(" \t\r");
  const std::string text = end == std::string::npos ? "" : line.substr(0, end + 1);
  const auto answered = std::ranges::find_if(open_, [&](const Slot& slot) { return text == "save " + slot.name; });
  if (answered == open_.end()) return false;
  const Slot slot = *answered;
  open_.erase(answered);
  save(slot);
  return true;
}

void FirstSaves::save(const Slot& slot) { scope_.spawn(save_and_reset(*session_, slot.bus, slot.name, say_)); }

}  // namespace berth::cli
