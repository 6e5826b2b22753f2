/// A run's events as lines for people.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/report.hpp"

namespace berth::cli {

/// What is said of several slots at one instant is one line: "left, right and 38 more: empty: …". A line is complete
/// when the next instant begins, or what is said differs: until then it waits here.
class EventLines {
 public:
  /// `wall_clock`: the time of day stands before the bus's time.
  explicit EventLines(bool wall_clock) noexcept : wall_clock_(wall_clock) {}

  /// The lines that are complete by this event.
  [[nodiscard]] std::vector<std::string> add(const operate::Event& event);
  /// What waits still.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  [[nodiscard]] bool joins(const operate::Event& event) const;
  void complete(std::vector<std::string>& into);

  bool wall_clock_;
  std::optional<operate::Event> waiting_;
  std::vector<std::string> slots_;  // of `waiting_`
};

}  // namespace berth::cli
