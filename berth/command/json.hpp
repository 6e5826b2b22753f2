/// JSON for the verbs' replies.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "berth/base/ids.hpp"

namespace berth::command {

using Json = nlohmann::ordered_json;

[[nodiscard]] std::string hex(std::uint32_t value, unsigned digits = 8);  ///< "0x0000000A"
[[nodiscard]] std::string dump(const Json& json);                         ///< one line; bad UTF-8 replaced
/// Adds "address", "type" and "r_sn".
void put_address(Json& json, const Identity& device);

}  // namespace berth::command
