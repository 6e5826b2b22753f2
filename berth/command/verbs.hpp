/// The verbs: what a request can ask for, and what carries it out. `verbs` is the table of them all, for whoever offers
/// them to a person or to another program.
///
/// Verbs and their arguments, all text as the person wrote it; numbers in C notation, `?` = may be left out. `bus` may
/// be left out of all of them when the machine has one bus; `scan` and `bind` then take every bus.
///
/// On a real bus, `nmt` resets, `lss` services and `sdo write` to 1010h and 1011h take yes? ("1") too: without it they
/// are refused (status 1, {"result": "unconfirmed"}) while a device that they disturb is operational.
///
///     report
///     scan              bus?
///     bind              bus?, method? ("auto" or a discovery method; default: the machine file's),
///                       from-scratch? ("1": take every node-ID that LSS can change first), yes? ("1": confirms that)
///     replace           slot (name, "bus/name" or node-ID), device? (LSS address that shall sit there)
///     forget            bus?, device (LSS address): gone for good; its unfinished loss of a node-ID is given up
///     locate            bus?, target (slot, LSS address or node-ID), seconds? (1..600, default 10), anyway? ("1")
///     configure         bus?, slot?, check? ("1": compare only)
///     sdo read          node, index, sub?, type?                  type: u8 ... vs, see od::data_type
///     sdo write         node, index, sub?, value, type?           without a type the value is hex bytes: "91 01 0F"
///     sdo probe         node, objects (hex: "1000:0,1018:0-4")    reads all; a device's refusal is told, no failure
///     nmt               command (start stop preop reset-node reset-comm), node (1..127 or "all")
///     lss global        state (waiting, configuration)
///     lss select        address
///     lss inquire       address?                                  without: the device in configuration state
///     lss set-node-id   address, id (1..127, 255 = none), store? ("1")
///     lss store         address?
///     lss bit-timing    rate (bit/s), address?
///     lss activate      delay (ms), rate? (bit/s that Berth's own port changes to)
///     lss identify      vendor, product, revision-low?, revision-high?, serial-low?, serial-high?
///     lss find
///     lss move-bit-rate rate (bit/s), delay? (ms), yes? ("1"; without it nothing is changed)
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/command/request.hpp"
#include "berth/operate/session.hpp"
#include "berth/rt/task.hpp"

namespace berth::command {

struct Verb {
  std::string_view name;                         ///< "sdo read"
  std::span<const std::string_view> parameters;  ///< the arguments that it takes beside "yes"; any other is refused
  rt::Task<void> (*run)(operate::Session& session, const Request& request, Reply& reply);  ///< see `execute`
};

/// In the order of the table above.
[[nodiscard]] std::span<const Verb> verbs() noexcept;
/// Null when there is none of this name.
[[nodiscard]] const Verb* verb(std::string_view name) noexcept;

/// The frames that a command sends whatever is answered, up to the first answer it needs: one NMT command, an LSS
/// service, the initiate frame of an SDO transfer. Empty for commands that depend on what they hear; `problem` says
/// why, or what is wrong with the request.
[[nodiscard]] std::vector<can::Frame> foreseeable_frames(const Request& request, std::string& problem);

/// Runs one command. `request` and `reply` must stay until the task is done. It waits until the main job has nothing to
/// do on the bus, and may wait for devices: give it a limit from outside, by destroying the task.
[[nodiscard]] rt::Task<void> execute(operate::Session& session, const Request& request, Reply& reply);

}  // namespace berth::command
