#include "live_values.hpp"

#include <algorithm>
#include <utility>

#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"

namespace berth::cli {

std::vector<std::string> watch_words(const design::Machine& machine) {
  std::vector<std::string> words;
  for (const auto& end : machine.watch) words.push_back(end.slot + "/" + end.object);
  return words;
}

LiveValues::LiveValues(tree::Session& session, Watched watched, rt::Duration every)
    : session_(&session), watched_(std::move(watched)), every_(every), scope_(session.executor()) {
  scope_.spawn(run());
}

// Why the node is not asked now; empty: it may be asked.
std::string LiveValues::why_not(std::size_t request) const {
  const auto& [bus, node] = watched_.where(request);
  for (const auto& slot : session_->slots()) {
    if (slot.bus != bus || slot.id != node) continue;
    return slot.state == places::SlotState::operational ? std::string() : places::name(slot.state);
  }
  return {};
}

rt::Task<void> LiveValues::run() {
  for (;;) {
    for (std::size_t i = 0; i < watched_.requests().size(); ++i) {
      const std::string why = why_not(i);
      if (!why.empty()) {
        watched_.pass_over(i, why);
        continue;
      }
      request_ = watched_.requests()[i];
      co_await command::execute(*session_, request_, reply_);
      static_cast<void>(watched_.take(i, reply_, session_->executor().now()));
    }
    co_await rt::sleep_for(every_);
  }
}

}  // namespace berth::cli
