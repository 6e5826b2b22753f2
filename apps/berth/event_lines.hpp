/// A run's events as lines for users and logs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/operate/report.hpp"

namespace berth::cli {

/// Joins one message about several slots at one instant into a line: "left, right and 38 more: empty: …". A line is
/// complete when the next instant begins or the message differs; until then it is held back.
class EventLines {
 public:
  /// What begins a line.
  enum class Head : std::uint8_t {
    bus_time,
    time_of_day,  ///< before the bus's time
    level,        ///< before the bus's time, as sd-daemon(3) has it; a journal has the time of day of its own
  };
  explicit EventLines(Head head) noexcept : head_(head) {}

  /// The lines that this event completes.
  [[nodiscard]] std::vector<std::string> add(const operate::Event& event);
  /// The lines that are held back.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  [[nodiscard]] bool joins(const operate::Event& event) const;
  void complete(std::vector<std::string>& into);

  Head head_;
  std::optional<operate::Event> waiting_;
  std::vector<std::string> slots_;  // of `waiting_`
};

}  // namespace berth::cli
