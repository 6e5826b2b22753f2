#include "berth/command/json.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace berth::command {

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string hex(std::uint32_t value, unsigned digits) { return fmt::format("0x{:0{}X}", value, digits); }

void put_address(Json& json, const Identity& device) {
  json["address"] = to_string(device);
  json["type"] = nullptr;
  json["r_sn"] = nullptr;
  if (device.knows(0) && device.knows(1))
    json["type"] = fmt::format("0x{:08X}{:08X}", device.address.vendor, device.address.product);
  if (device.knows(2) && device.knows(3)) json["r_sn"] = fmt::format("0x{:016X}", device.r_sn().value());
}

}  // namespace berth::command
