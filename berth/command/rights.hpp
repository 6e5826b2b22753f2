/// Which party may use which verb (docs/security.md §Who may command what): one function for every face of Berth, by
/// the columns of the table of verbs.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "berth/command/request.hpp"
#include "berth/command/role.hpp"
#include "berth/design/machine.hpp"

namespace berth::command {

/// Where a request came from.
enum class Face : std::uint8_t {
  person,   ///< the command line, or the control socket: this account's, or root's
  program,  ///< the command buffer of the library: the application itself
  gateway,  ///< a client of CiA 309-3: anyone who reaches its port
  node,     ///< a node of the bus, by the objects of Berth's own device (1023h)
  studio,   ///< a page of `berth up --studio`: whoever has the token; its confirmation is "yes"
  mqtt      ///< a host application at the MQTT broker: whoever may publish commands there
};

/// Rights granted to a face, in addition to its own.
struct Granted {
  std::string_view bus{};  ///< node: for the answer
  /// node: `[bus.NAME.commands]` of its bus; mqtt: `commands` of `[mqtt]`, or the write of an object that is marked
  /// writable; null: nothing
  const design::BusCommands* listed = nullptr;
  /// gateway: `--commands`, or no real bus is touched; studio: unlocked by a user, or no real bus is touched
  bool changes = false;
  Role role = Role::configure;  ///< studio: that of the token
};

/// The role that a request needs: that of the table, and at least operate if an argument makes the verb change
/// something. The process's own verbs ("sim") need operate if they change the plant.
[[nodiscard]] Role role_needed(const Request& request);
/// Empty: `has` is enough. Else the message: `what` needs another role.
[[nodiscard]] std::string why_role_refused(std::string_view what, Role needed, Role has);

/// Empty: allowed. Else the message for the sender. Unknown verbs and arguments are not checked here (`Arguments`
/// refuses them).
[[nodiscard]] std::string why_refused(Face face, const Request& request, const Granted& granted);

}  // namespace berth::command
