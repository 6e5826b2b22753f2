/// The contents of one bus's messages: the position of each slot's objects in the PDOs, and their receivers; from the
/// slots' descriptions, notes, configurations and links. Nothing is asked on the bus.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/command/notes.hpp"
#include "berth/design/machine.hpp"
#include "berth/linker/plan.hpp"
#include "berth/od/values.hpp"
#include "berth/rt/executor.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::document {

/// An object in a PDO.
struct Signal {
  std::string name;  ///< the object's, from the description; may be empty
  ObjectRef object{};
  unsigned at = 0;  ///< its first bit in the PDO (CiA 301 §7.1.4: bit 0 of byte 0 is 0)
  unsigned bits = 0;
  od::DataType type = od::DataType::none;
  od::Meaning meaning{};                 ///< unit and names of values, from the description or from notes
  std::vector<std::string> receivers{};  ///< slots
};

struct Message {
  std::uint32_t key = 0;  ///< identifier, with `can::extended_flag`
  std::string name;       ///< "TPDO 1", "heartbeat"
  std::string sender;     ///< a slot, or "master"; empty: no slot of the bus sends it
  unsigned bytes = 0;
  std::optional<rt::Duration> period{};  ///< if it is cyclic
  std::vector<Signal> signals{};         ///< ascending by `at`
};

struct BusSignals {
  std::string bus;
  std::uint32_t bit_rate = 0;
  std::vector<std::string> senders{};  ///< slots in their order, then "master"
  std::vector<Message> messages{};     ///< ascending by `key`
};

/// A slot and its dictionary in the configured state.
struct DescribedSlot {
  const design::Slot* slot = nullptr;
  std::unique_ptr<od::Values> values{};              ///< null: nothing is known of its device
  std::vector<linker::Variable> variables{};         ///< network variables that its links make on it
  std::shared_ptr<const command::NoteBook> notes{};  ///< of its description; slots with one file share it
};

/// In the machine's order. Reads the files of notes. `links`: of a plan without errors, or null.
[[nodiscard]] std::vector<DescribedSlot> configured_slots(const design::Machine& machine,
                                                          const traffic::LinkPlan* links);

/// PDOs, heartbeats, EMCYs, SDO's default channels, NMT and SYNC. `slots`: of all buses.
[[nodiscard]] BusSignals signals_of(const design::Bus& bus, const std::vector<DescribedSlot>& slots);

}  // namespace berth::document
