/// The verbs: what a request can ask for, and what carries it out. `verbs` is the table of them all, for the command
/// line (its own table of verbs: apps/berth/main.cpp), the control socket and `serve`.
///
/// Verbs and their arguments, all text as the person wrote it; numbers in C notation, `?` = may be left out. `bus` may
/// be left out of all of them when the machine has one bus, and where a slot's name says it; `scan` and `bind` then
/// take every bus. A node is a node-ID or a slot's name, an object an index such as 1018h:04 or its name (objects.hpp).
///
/// On a real bus, `nmt` resets, `boot`, `lss` services, `store`, `restore`, `send`, `program` (but its status) and
/// `sdo write` to 1010h and 1011h take yes? ("1") too: without it they are refused (status 1, {"result":
/// "unconfirmed"}) while a device that they disturb is operational.
///
///     report            bus?                                      status 1 while a slot is not operational
///     scan              bus?
///     bind              bus?, method? ("auto" or a discovery method; default: the machine file's),
///                       from-scratch? ("1": take every node-ID that LSS can change first), yes? ("1": confirms that)
///     replace           slot (name, "bus/name" or node-ID), device? (LSS address that shall sit there), used? ("1":
///     also
///                       one that has a node-ID of elsewhere)
///     forget            bus?, device (LSS address): gone for good; its unfinished loss of a node-ID is given up
///     locate            bus?, target (slot, LSS address or node-ID), seconds? (1..600, default 10), anyway? ("1")
///     boot              bus?                                      not while the main job runs
///     configure         bus?, slot?, check? ("1": compare only)
///     upload            bus?, slot, dcf? ("1": the whole DCF in the answer)    what its device has now: its 1F20h
///     sdo read          node, object (several: one a line), sub?, type? (u8 ... vs, see od::data_type; default: what
///                       the description says), block? ("1": by block transfer and by nothing else)
///     sdo write         the same, value (several objects: one a line; of an unknown type hex bytes: "91 01 0F"),
///                       anyway? ("1": also outside of the description's limits)
///     sdo probe         node, objects (hex: "1000:0,1018:0-4")    reads all; a device's refusal is told, no failure
///     sdo dump          node                                      every object that can be read
///     sdo connect       client, server (nodes), lease? (s), request? (node-ID of the SDO manager that is asked by its
///                       1F00h)                            a channel from client to server (CiA 302-5)
///     sdo release       client, server, request?
///     sdo channels      bus?
///     nmt               command (start stop preop reset-node reset-comm), node (or "all"), request? (node-ID of
///                       an NMT master that is asked for it by its 1F82h; nothing is sent to the node itself)
///     program status    node, number?         1F51h, 1F56h, 1F57h of its programs; status 1: one does not run
///     program download  node, number?, file? (default: those of its slot), identification? (1F56h)
///     program start, program stop, program clear      node, number? (1 to 254, default 1)
///     emcy              node?, listen? (s)    1001h and 1003h of a node; with `listen` the messages that come
///     store, restore    node, group? (all, communication, application, 4..127; default all)       1010h, 1011h
///     send              frame (as candump writes it; several: one a line)
///     history           bus?, slot?           what the store tells
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

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/command/request.hpp"
#include "berth/rt/task.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// What carrying out a verb does at most, whatever its arguments.
enum class Effect : std::uint8_t {
  asks,    ///< it reads and asks: devices, bus and store are afterwards as they were
  changes  ///< devices, what the bus does, or what the store knows
};

/// An argument of a verb.
struct Parameter {
  std::string_view name;
  bool personal = false;  ///< a person alone may give it: a file of this computer, or a confirmation
};

struct Verb {
  std::string_view name;                  ///< "sdo read"
  Effect effect;                          ///< what rights ask about (rights.hpp)
  std::span<const Parameter> parameters;  ///< the arguments that it takes beside "yes"; any other is refused
  rt::Task<void> (*run)(tree::Session& session, const Request& request, Reply& reply);  ///< see `execute`

  /// Null: it takes no argument of this name. "yes" is a personal one of all.
  [[nodiscard]] const Parameter* parameter(std::string_view name) const noexcept;
};

/// In the order of the table above.
[[nodiscard]] std::span<const Verb> verbs() noexcept;
/// Null when there is none of this name.
[[nodiscard]] const Verb* verb(std::string_view name) noexcept;

/// The frames that a command sends whatever is answered, up to the first answer it needs: one NMT command, an LSS
/// service, the initiate frame of an SDO transfer. Empty for commands that depend on what they hear; `problem` says
/// why, or what is wrong with the request. `machine`: for names; one without slots knows none.
[[nodiscard]] std::vector<can::Frame> foreseeable_frames(const Request& request, const design::Machine& machine,
                                                         std::string& problem);

/// Runs one command. `request` and `reply` must stay until the task is done. It waits until the main job has nothing to
/// do on the bus, and may wait for devices: give it a limit from outside, by destroying the task.
[[nodiscard]] rt::Task<void> execute(tree::Session& session, const Request& request, Reply& reply);

}  // namespace berth::command
