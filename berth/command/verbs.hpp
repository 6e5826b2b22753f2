/// The verbs: the possible requests, and the functions that carry them out (execute.hpp). `verbs` is the table of all
/// verbs, for the command line (its own table of verbs: apps/berth/main.cpp), the control socket and `serve`.
///
/// The arguments of each are in the table (verbs.cpp), and `berth help VERB` prints them. All arguments are text as the
/// user wrote it, numbers in C notation, yes is "1". `bus` may be omitted if the machine has one bus, or if a slot's
/// name determines it; `scan` and `bind` then use every bus. A node is a node-ID or a slot's name, an object an index
/// such as 1018h:04 or its name (objects.hpp); several objects, values or frames are given one per line.
///
/// On a real bus, these take yes too: `nmt` resets, `boot`, `lss` services, `store`, `restore`, `backup restore`,
/// `send`, `program` (except its status), a `doctor` that asks, and `sdo write` to 1010h and 1011h. Without it they are
/// refused (status 1, {"result": "unconfirmed"}) while a device that they disturb is operational.
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

/// The strongest effect of a verb, without arguments marked `changes`.
enum class Effect : std::uint8_t {
  asks,    ///< it reads and asks: devices, bus and store stay as they were
  changes  ///< devices, the activity on the bus, or the store's content
};

/// How a user writes an argument on the command line.
enum class Form : std::uint8_t {
  word,    ///< without a name, in the order of the table
  option,  ///< `--serial-low 16`
  flag,    ///< `--used`, for "1"
  common,  ///< `--bus`, as for every verb
  own      ///< other; the verb's own file of apps/berth reads it: `--lease "60 s"` for "60"
};

/// An argument of a verb.
struct Parameter {
  std::string_view name;  ///< in a request
  Form form = Form::common;
  std::string_view help{};  ///< for users: its meaning, range and default
  bool required = false;
  std::string_view value{};    ///< placeholder for its value in the help: "MS"
  std::string_view spelled{};  ///< the spelling of an option or a flag, if not its name: "--save"
  std::string_view choices{};  ///< all that its value may be, with blanks between; empty: something else
  bool personal = false;       ///< only a user may give it: a file of this computer, or a confirmation
  bool changes = false;        ///< with it, a verb that otherwise only asks changes something
};

struct Verb {
  std::string_view name;  ///< "sdo read"
  std::string_view help;  ///< for users, one line
  Role role;              ///< the role needed, if roles are used (rights.hpp)
  /// Its arguments beside "yes"; any other is refused, and so is a request without a required one.
  std::span<const Parameter> parameters;
  rt::Task<void> (*run)(tree::Session& session, const Request& request, Reply& reply);  ///< see `execute`

  /// Null: it has no argument of this name. "yes" is a personal argument of all verbs.
  [[nodiscard]] const Parameter* parameter(std::string_view name) const noexcept;
  /// Used by rights (rights.hpp): a verb that role view may use only asks.
  [[nodiscard]] Effect effect() const noexcept { return role == Role::view ? Effect::asks : Effect::changes; }
};

/// A request that is not in the table: the machines of a running machine's group at its broker (docs/api.md §The
/// fleet). It asks; the process that runs the machine answers it.
inline constexpr std::string_view fleet_verb = "fleet";

/// In the order of the table in verbs.cpp.
[[nodiscard]] std::span<const Verb> verbs() noexcept;
/// Null: there is none of this name.
[[nodiscard]] const Verb* verb(std::string_view name) noexcept;

/// The frames that a command sends regardless of answers, up to the first answer that it needs: one NMT command, an LSS
/// service, the initiate frame of an SDO transfer. Empty for commands that depend on received frames; `problem` gives
/// the reason, or the error in the request. `machine`: for names; one without slots has none.
[[nodiscard]] std::vector<can::Frame> foreseeable_frames(const Request& request, const design::Machine& machine,
                                                         std::string& problem);

}  // namespace berth::command
