/// Whether a command may use a bus (`design::Role`). What a person confirms first: confirm.hpp; what a user may do:
/// rights.hpp.
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

/// The network that a command is for, or for people why there is none or it must not be used so. An empty `bus` means
/// the machine's only one.
[[nodiscard]] tl::expected<operate::Network*, std::string> network_for(tree::Session& session, const std::string& bus,
                                                                       Use use);
/// All buses when none is named.
[[nodiscard]] tl::expected<std::vector<operate::Network*>, std::string> networks_for(tree::Session& session,
                                                                                     const std::string& bus, Use use);

struct OwnSlot {
  operate::Network* network = nullptr;
  std::string name;  ///< plain
};
/// A slot by its name, "bus/name" or its node-ID when that is unique, on `bus` or, when that is empty, on all. Else why
/// there is none, for people: the machine has none or several, or Berth has no port on its bus, behind which `beneath`
/// says what to do.
[[nodiscard]] tl::expected<OwnSlot, std::string> own_slot(tree::Session& session, const std::string& bus,
                                                          const std::string& slot, std::string_view beneath);

}  // namespace berth::command
