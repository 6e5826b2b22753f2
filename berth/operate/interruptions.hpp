/// How often the bus or a user may interrupt one search. A device that boots, and a command, need not wait for its end;
/// but an interrupted search begins again with the way down to one device, and would never get there if it were
/// interrupted at each of these ways.
#pragma once

#include <optional>

#include "berth/discovery/discovery.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

class Interruptions {
 public:
  /// Interruptions of a search that does not progress, in `within` from the first of them.
  static constexpr unsigned most = 4;

  /// May the search be interrupted here? True counts as an interruption. One that has progressed since the last one
  /// loses nothing, since what it swept is kept: its interruptions are counted anew.
  [[nodiscard]] bool allow(rt::Time now, const discovery::Progress& here, rt::Duration within) noexcept;
  /// The search ended: what comes next is another one.
  void search_ended() noexcept;

 private:
  unsigned count_ = 0;
  std::optional<discovery::Progress> last_;  // where it was interrupted
  rt::Time counted_until_{};
};

}  // namespace berth::operate
