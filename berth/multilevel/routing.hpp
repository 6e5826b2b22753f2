/// The routing database of a signal gateway (paper 3 Figure 14; docs/multilevel.md §Signals): which signals cross it,
/// when, and how late they may be. Data, apart from the engine (`SignalGateway`) and from the application.
#pragma once

#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/description.hpp"
#include "berth/rt/executor.hpp"

namespace berth::multilevel {

/// One signal: the value of an object on one side becomes that of an object of equal size on another.
struct Signal {
  /// What its target does while it is not forwarded.
  enum class Stopped : std::uint8_t {
    hold,        ///< keeps the last value, and is sent on as its TPDO says
    substitute,  ///< gets `substitute`
    silent,      ///< its TPDO is not sent, so that the consumers' RPDO deadline tells them (EMCY 8250h)
  };
  std::string name;
  std::uint8_t from = 0;  ///< side: 0 the upstream one, n the bus beneath port n
  std::uint8_t to = 1;
  ObjectRef source;
  ObjectRef target;
  std::uint32_t modes = 0xFFFF'FFFF;  ///< bit m: forwarded in mode m
  rt::Duration budget{};              ///< longest delay from its reception to its frame on the other wire; 0: none
  rt::Duration freshness{};           ///< not received for so long: not forwarded any more; 0: never
  bool every = false;                 ///< each reception is an event of its TPDO, not only another value
  Stopped stopped = Stopped::hold;
  std::vector<std::uint8_t> substitute{};
};

/// Why a signal cannot be forwarded.
struct SignalProblem {
  std::size_t signal = 0;  ///< position in the table
  std::string text;        ///< "drive: 2100h:00 is not there on side 0"
};
/// What is wrong with a table for these sides' dictionaries: a side, object or substitute that does not fit, objects of
/// other sizes, two signals into one object in one mode, signals that lead round in a loop, safety-relevant data (SRDO,
/// EN 50325-5): these are never forwarded, as a gateway in between is none of their safety functions' parts (S3.36).
[[nodiscard]] std::vector<SignalProblem> problems(const std::vector<Signal>& table,
                                                  const std::vector<const od::Description*>& sides);

/// Part of an SRDO (1301h to 13FFh, or in the default of a mapping 1381h to 13C0h).
[[nodiscard]] bool is_safety_relevant(const od::Description& description, ObjectRef ref);

}  // namespace berth::multilevel
