/// Which device belongs in which slot: paper 1's rules 1 and 2 (§III; S1.27), with what they leave open decided so that
/// nothing is ever guessed (S1.32..S1.36). Pure: what is known goes in, what to do comes out.
#pragma once

#include <string>
#include <vector>

#include "berth/places/oddity.hpp"
#include "berth/places/slot.hpp"
#include "berth/rt/executor.hpp"

namespace berth::places {

/// A device that was found on the bus.
struct Found {
  Identity device;
  NodeId active;        ///< the node-ID it uses now; unconfigured for a blank device
  bool clone = false;   ///< more than one device answered to this address
  rt::Time seen = {};   ///< when it became active: its boot-up message, else the first answer to a search
  bool lent = false;    ///< `active` was lent to it for a search: it says nothing about its place, and is taken back
                        ///< by the lender when it is in the way
  bool shared = false;  ///< another device uses `active` too: it says nothing about its place
  bool keeps = false;   ///< nothing changes `active`: it sits in the slot of that node-ID or in none
  friend bool operator==(const Found&, const Found&) = default;
};

/// 1018h has less than LSS tells, and one device was found by both: the name that says more is enough. True: that is
/// in the list. Names that say less than `found` does are taken out.
bool drop_shorter_names(std::vector<Found>& list, const Found& found);

/// A slot as wanted, and as known.
struct Slot {
  SlotSpec spec;
  SlotRecord record;
};

/// Bind a device to a slot, or take its node-ID away.
struct Action {
  enum class Kind : std::uint8_t { blank, bind };
  Kind kind = Kind::bind;
  std::size_t slot = 0;  ///< index into the slots given; meaningless for `blank`
  Identity device;
  std::string reason;  ///< for the history
};

/// What only a person can answer: which of these devices belongs in which of these slots?
struct Question {
  std::vector<std::size_t> slots;
  std::vector<Identity> devices;
  std::string brief;  ///< what is asked, without the names and what to do
  std::string text;   ///< the whole; of many devices and slots the first ones only
};

struct Plan {
  std::vector<Action> actions;  ///< in this order: blanks, unfinished bindings, repairs, new bindings
  std::vector<Question> questions;
  std::vector<Oddity> oddities;
  std::vector<Identity> probes;  ///< new devices whose place is not known before their `SlotSpec::probe` was read
};

/// True when a device of this address may sit in this slot: rule 1 and the slot's revision rule.
[[nodiscard]] bool fits(const SlotSpec& slot, const Identity& device) noexcept;

/// The objects that tell a device of this address from others of its kind, each once: those of all slots it fits.
[[nodiscard]] std::vector<Probe> probes_for(const std::vector<Slot>& slots, const Identity& device);

/// Plans one bus. `slots` are the slots of that bus; `found` what discovery heard, registered devices included when
/// they were heard at a node-ID that is not theirs; `unfinished_blanks` from the store; `master` is the master's
/// node-ID; `readings` what was read of the objects of `probes_for`.
///
/// Which device gets which slot, first what is certain: an unfinished or known binding; a listed spare its slot; a
/// device with a probe the slot whose probe it shows. What is left goes by `when_ambiguous` of the type's lowest free
/// slot.
[[nodiscard]] Plan plan(const std::vector<Slot>& slots, const std::vector<Found>& found,
                        const std::vector<Identity>& unfinished_blanks, NodeId master,
                        const std::vector<Reading>& readings = {});

}  // namespace berth::places
