/// The verbs: what a request can ask for, and what carries it out (execute.hpp). `verbs` is the table of them all, for
/// the command line (its own table of verbs: apps/berth/main.cpp), the control socket and `serve`.
///
/// What each takes is in the table (verbs.cpp), and `berth help VERB` prints it. All arguments are text as the person
/// wrote it, numbers in C notation, yes is "1". `bus` may be left out when the machine has one bus, and where a slot's
/// name says it; `scan` and `bind` then take every bus. A node is a node-ID or a slot's name, an object an index such
/// as 1018h:04 or its name (objects.hpp); several objects, values or frames stand one a line.
///
/// On a real bus, `nmt` resets, `boot`, `lss` services, `store`, `restore`, `backup restore`, `send`, `program` (but
/// its status), a `doctor` that asks and `sdo write` to 1010h and 1011h take yes too: without it they are refused
/// (status 1,
/// {"result": "unconfirmed"}) while a device that they disturb is operational.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/role.hpp"
#include "berth/rt/task.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// What carrying out a verb does at most, whatever its arguments but those that say `changes`.
enum class Effect : std::uint8_t {
  asks,    ///< it reads and asks: devices, bus and store are afterwards as they were
  changes  ///< devices, what the bus does, or what the store knows
};

/// How a person writes an argument on the command line.
enum class Form : std::uint8_t {
  word,    ///< by itself, in the order of the table
  option,  ///< `--serial-low 16`
  flag,    ///< `--used`, for "1"
  common,  ///< `--bus`, as of every verb
  own      ///< otherwise, and the verb's own file of apps/berth reads it: `--lease "60 s"` for "60"
};

/// An argument of a verb.
struct Parameter {
  std::string_view name;  ///< in a request
  Form form = Form::common;
  std::string_view help{};  ///< for people: what it says, its range, its default
  bool required = false;
  std::string_view value{};    ///< what stands for its value in the help: "MS"
  std::string_view spelled{};  ///< an option or a flag that is not spelled as its name: "--save"
  bool personal = false;       ///< a person alone may give it: a file of this computer, or a confirmation
  bool changes = false;        ///< with it a verb changes something that else only asks
};

struct Verb {
  std::string_view name;  ///< "sdo read"
  std::string_view help;  ///< for people, one line
  Role role;              ///< who may have it carried out where roles are asked for (rights.hpp)
  /// The arguments that it takes beside "yes"; any other is refused, and so is a request without a required one.
  std::span<const Parameter> parameters;
  rt::Task<void> (*run)(tree::Session& session, const Request& request, Reply& reply);  ///< see `execute`

  /// Null: it takes no argument of this name. "yes" is a personal one of all.
  [[nodiscard]] const Parameter* parameter(std::string_view name) const noexcept;
  /// What rights ask about (rights.hpp): a verb that role view may use only asks.
  [[nodiscard]] Effect effect() const noexcept { return role == Role::view ? Effect::asks : Effect::changes; }
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

}  // namespace berth::command
