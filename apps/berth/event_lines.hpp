/// A run's events as lines for users.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/report.hpp"

namespace berth::cli {

/// Joins one message about several slots at one instant into a line: "left, right and 38 more: empty: …". A line is
/// complete when the next instant begins or the message differs; until then it is held back.
class EventLines {
 public:
  /// `wall_clock`: print the time of day before the bus's time.
  explicit EventLines(bool wall_clock) noexcept : wall_clock_(wall_clock) {}

  /// The lines that this event completes.
  [[nodiscard]] std::vector<std::string> add(const operate::Event& event);
  /// The lines that are held back.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  [[nodiscard]] bool joins(const operate::Event& event) const;
  void complete(std::vector<std::string>& into);

  bool wall_clock_;
  std::optional<operate::Event> waiting_;
  std::vector<std::string> slots_;  // of `waiting_`
};

}  // namespace berth::cli
