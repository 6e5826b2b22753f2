/// Whether a command may use a bus (`design::Role`). Confirmations by a user: confirm.hpp; rights of users: rights.hpp.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/tree/session.hpp"

namespace berth::command {

/// How a command uses a bus, for `design::Role`.
enum class Use : std::uint8_t { look, send, command };  ///< nothing, frames, NMT start or reset

/// The network for a command, or the reason for users: there is none, or it must not be used this way. An empty `bus`
/// means the machine's only one.
[[nodiscard]] tl::expected<operate::Network*, std::string> network_for(tree::Session& session, const std::string& bus,
                                                                       Use use);
/// All buses if none is named.
[[nodiscard]] tl::expected<std::vector<operate::Network*>, std::string> networks_for(tree::Session& session,
                                                                                     const std::string& bus, Use use);

struct OwnSlot {
  operate::Network* network = nullptr;
  std::string name;  ///< plain
};
/// A slot by its name, "bus/name" or its node-ID if that is unique, on `bus` or, if empty, on all. Else the reason for
/// users: the machine has none or several, or Berth has no port on its bus; `beneath` then adds what to do.
[[nodiscard]] tl::expected<OwnSlot, std::string> own_slot(tree::Session& session, const std::string& bus,
                                                          const std::string& slot, std::string_view beneath);

}  // namespace berth::command
