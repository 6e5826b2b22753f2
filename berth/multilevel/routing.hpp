/// The routing database of a signal gateway (paper 3 Figure 14; docs/multilevel.md §Signals): which signals cross it,
/// when, and how late they may be. Data only, separate from the engine (`SignalGateway`) and the application.
#pragma once

#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/description.hpp"
#include "berth/rt/executor.hpp"

namespace berth::multilevel {

/// One signal: copies the value of an object on one side to an object of equal size on another.
struct Signal {
  /// What happens to its target while it is not forwarded.
  enum class Stopped : std::uint8_t {
    hold,        ///< keeps the last value, sent as its TPDO says
    substitute,  ///< gets `substitute`
    silent,      ///< its TPDO is not sent, so that the consumers' RPDO deadline expires (EMCY 8250h)
  };
  std::string name;
  std::uint8_t from = 0;  ///< side: 0 upstream, n the bus beneath port n
  std::uint8_t to = 1;
  ObjectRef source;
  ObjectRef target;
  std::uint32_t modes = 0xFFFF'FFFF;  ///< bit m: forwarded in mode m
  rt::Duration budget{};              ///< longest delay from its reception to its frame on the other wire; 0: none
  rt::Duration freshness{};           ///< not forwarded after this time without reception; 0: no limit
  bool every = false;                 ///< each reception triggers its TPDO, even with the same value
  Stopped stopped = Stopped::hold;
  std::vector<std::uint8_t> substitute{};
};

/// Why a signal cannot be forwarded.
struct SignalProblem {
  std::size_t signal = 0;  ///< index in the table
  std::string text;        ///< "drive: 2100h:00 is not there on side 0"
};
/// Checks a table against the sides' dictionaries. Errors: a side, object or substitute that does not fit; objects of
/// different sizes; two signals into one object in one mode; signals that form a loop; safety-relevant data (SRDO, EN
/// 50325-5), which are never forwarded, because a gateway is not part of their safety function (S3.36).
[[nodiscard]] std::vector<SignalProblem> problems(const std::vector<Signal>& table,
                                                  const std::vector<const od::Description*>& sides);

/// Part of an SRDO (1301h to 13FFh, or in the default value of a mapping 1381h to 13C0h).
[[nodiscard]] bool is_safety_relevant(const od::Description& description, ObjectRef ref);

}  // namespace berth::multilevel
