/// What the verbs' source files put into a `Reply`.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/command/request.hpp"

namespace berth::command {

using Json = nlohmann::ordered_json;

void give(Reply& reply, const Json& json, std::vector<std::string> lines);
/// One line for people: a name of a device or of a client's request begins no other.
[[nodiscard]] std::string error_line(const std::string& message, const std::string& fix = {});
/// `message` for people, `fix` what to do.
void refuse(Reply& reply, int status, const std::string& message, const std::string& fix = {});
/// The exit status of an error: 3 when the bus or a file failed, else 1.
[[nodiscard]] int status_of(Errc code) noexcept;
/// An error of a service: status by its code, abort code with its text. `where`: "bus backbone, SDO read". `path`: of
/// its node, where that is beneath gateways; else empty.
void fail_with(Reply& reply, const Error& error, const std::string& where, const std::string& fix = {},
               const std::string& path = {});

[[nodiscard]] std::string hex(std::uint32_t value, unsigned digits = 8);  ///< "0x0000000A"
[[nodiscard]] std::string dump(const Json& json);                         ///< one line; bad UTF-8 replaced
/// Adds "address", "type" and "r_sn".
void put_address(Json& json, const Identity& device);

}  // namespace berth::command
