/// What is due on one bus. The parts of a `Network` write it, its main job reads it.
#pragma once

#include <bitset>
#include <optional>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/operate/out_of_lss.hpp"
#include "berth/rt/mailbox.hpp"

namespace berth::operate {

/// Where the main job is.
enum class Phase : std::uint8_t { opening, preparation, discovery, binding, start, watch };
[[nodiscard]] const char* name(Phase phase) noexcept;

/// A message from the bus or from a user. The main job acts on it when it holds the turn.
struct Wake {
  enum class Kind : std::uint8_t { boot_up, lost, recovered, state, look };
  Kind kind = Kind::look;
  NodeId node;
  rt::Time at{};
};

/// Whether extended frames pass on the bus (`tell_all_unknown`).
struct ExtendedFrames {
  std::optional<bool> pass{};  ///< empty: none was sent yet
  std::uint32_t bus_offs = 0;  ///< of this port, in this run
};

struct Agenda {
  Agenda(rt::Executor& executor, const std::string& discovery) : wakes(executor), of_bus(discovery) {}

  /// How devices are found: "auto", or a name of `discovery::Method`.
  [[nodiscard]] const std::string& method() const noexcept { return of_command.empty() ? of_bus : of_command; }

  rt::Mailbox<Wake, 512> wakes;
  Phase phase = Phase::opening;
  std::string of_bus;        ///< `discovery =`
  std::string of_command;    ///< in its place while `berth bind` runs
  bool look_anew = true;     ///< the next look asks all devices, not only those that are unknown
  rt::Time anew_at{};        ///< no such look before this time
  rt::Time retry_at{};       ///< failed work is not tried again before this time
  bool retries = false;      ///< the present round tries failed work again
  rt::Time rest_at{};        ///< no earlier search for devices without RAND, unless something else asks
  bool calls = false;        ///< a slot's device sent something that needs action: a search stops for it
  std::bitset<128> comes;    ///< node-IDs under which a device without a slot booted that was not asked since
  bool search_open = false;  ///< the last search did not finish yet
  bool speaks = false;       ///< the master's own device is on
  bool alone = false;        ///< no node acknowledged the opening: no node-ID is asked before a search succeeds
  ExtendedFrames extended;
  OutOfLss out_of_lss;
  bool once = false;  ///< a single round (`berth bind`): there is no later look
};

}  // namespace berth::operate
