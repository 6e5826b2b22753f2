/// Decides which device belongs in which slot: paper 1's rules 1 and 2 (§III; S1.27), with their open points settled
/// so that nothing is ever guessed (S1.32..S1.36). Pure: facts in, actions out.
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
  rt::Time seen = {};   ///< when it became active: its boot-up message, else its first answer to a search
  bool lent = false;    ///< `active` was lent for a search: it does not show its place; the lender takes it back if
                        ///< needed
  bool shared = false;  ///< another device uses `active` too: it does not show its place
  bool keeps = false;   ///< nothing can change `active`: it sits in the slot of that node-ID or in none
  friend bool operator==(const Found&, const Found&) = default;
};

/// 1018h may give less than LSS, so one device may be found with two identities; the fuller one is kept. True: a fuller
/// one is in the list already. Removes identities that say less than `found`.
bool drop_shorter_names(std::vector<Found>& list, const Found& found);

/// A slot, with what is wanted and what is known.
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

/// A question for the user: which of these devices belongs in which of these slots?
struct Question {
  std::vector<std::size_t> slots;
  std::vector<Identity> devices;
  std::string brief;  ///< the question, without names and advice
  std::string text;   ///< the full text; names only the first of many devices and slots
};

struct Plan {
  std::vector<Action> actions;  ///< in this order: blanks, unfinished bindings, repairs, new bindings
  std::vector<Question> questions;
  std::vector<Oddity> oddities;
  std::vector<Identity> probes;  ///< new devices whose place is unknown until their `SlotSpec::probe` is read
};

/// True if a device of this address may sit in this slot, by rule 1 and the slot's revision rule.
[[nodiscard]] bool fits(const SlotSpec& slot, const Identity& device) noexcept;

/// The objects that distinguish a device of this address from others of its kind, each once: those of all slots that it
/// fits.
[[nodiscard]] std::vector<Probe> probes_for(const std::vector<Slot>& slots, const Identity& device);

/// Plans one bus.
/// - `slots`: the slots of that bus
/// - `found`: the devices that discovery heard, including registered ones heard at another node-ID than theirs
/// - `unfinished_blanks`: from the store
/// - `master`: the master's node-ID
/// - `readings`: the values of the objects of `probes_for`
///
/// Certain matches come first: an unfinished or known binding; a listed spare for its slot; a device with a probe for
/// the slot whose probe it shows. `when_ambiguous` of the type's lowest free slot decides the rest.
[[nodiscard]] Plan plan(const std::vector<Slot>& slots, const std::vector<Found>& found,
                        const std::vector<Identity>& unfinished_blanks, NodeId master,
                        const std::vector<Reading>& readings = {});

}  // namespace berth::places
