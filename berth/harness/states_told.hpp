// The states that a session has told of its slots.
#pragma once

#include <fmt/format.h>

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/operate/report.hpp"

namespace berth::harness {

class StatesTold {
 public:
  void take(const operate::Event& event) {
    if (event.kind == operate::EventKind::state) states_.emplace_back(event.slot, event.text);
  }
  void clear() { states_.clear(); }
  // How often each slot was reported in this state since `clear`.
  [[nodiscard]] std::map<std::string, unsigned> told(std::string_view state) const {
    std::map<std::string, unsigned> count;
    for (const auto& [slot, text] : states_) {
      if (text.starts_with(state)) ++count[slot];
    }
    return count;
  }

  // What is wrong where these slots were to be told so once each, and no other slot.
  [[nodiscard]] std::string judge(std::string_view state, const std::set<std::string>& whom) const {
    std::string wrong;
    const auto count = told(state);
    for (const auto& slot : whom) {
      const auto it = count.find(slot);
      const unsigned times = it == count.end() ? 0 : it->second;
      if (times != 1) wrong += fmt::format("slot {} was told to be {} {} times\n", slot, state, times);
    }
    for (const auto& [slot, times] : count) {
      if (!whom.contains(slot)) wrong += fmt::format("slot {} was told to be {}, and was not\n", slot, state);
    }
    return wrong;
  }

 private:
  std::vector<std::pair<std::string, std::string>> states_;  // slot, words
};

}  // namespace berth::harness
