#include "berth/command/reply.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/od/abort_code.hpp"
#include "berth/text/printable.hpp"

namespace berth::command {

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string hex(std::uint32_t value, unsigned digits) { return fmt::format("0x{:0{}X}", value, digits); }

void give(Reply& reply, const Json& json, std::vector<std::string> lines) {
  reply.json = dump(json);
  reply.lines = std::move(lines);
}

std::string error_line(const std::string& message, const std::string& fix) {
  return text::one_line(fix.empty() ? message : message + "; " + fix);
}

void refuse(Reply& reply, int status, const std::string& message, const std::string& fix) {
  Json json;
  json["error"]["message"] = message;
  if (!fix.empty()) json["error"]["fix"] = fix;
  reply.status = status;
  reply.json = dump(json);
  reply.lines.clear();
  reply.error = error_line(message, fix);
  reply.cause.reset();
}

int status_of(Errc code) noexcept {
  switch (code) {
    case Errc::bus:
    case Errc::io:
    case Errc::exhausted:
    case Errc::cancelled: return 3;
    default: return 1;
  }
}

void fail_with(Reply& reply, const Error& error, const std::string& where, const std::string& fix,
               const std::string& path) {
  Json json;
  auto& e = json["error"];
  e["code"] = name(error.code);
  if (error.node != 0) e["node"] = error.node;
  if (!path.empty()) e["path"] = path;
  std::string message = where + ": ";
  if (error.node != 0) message += path.empty() ? fmt::format("node {}", error.node) : "node " + path;
  if (error.index != 0) {
    e["object"] = fmt::format("0x{:04X}:{:02X}", error.index, error.sub);
    message += fmt::format("{}object {:04X}h:{:02X}", error.node != 0 ? ", " : "", error.index, error.sub);
  }
  if (error.node != 0 || error.index != 0) message += ": ";
  if (!path.empty() && error.code == Errc::unsupported)
    message = fmt::format("{}: node {}: node {} on the way is ", where, path, error.node);
  if (error.code == Errc::aborted && error.index != 0) {
    const auto* const text = od::text(static_cast<od::AbortCode>(error.detail));
    e["abort_code"] = hex(error.detail);
    e["text"] = text;
    message += fmt::format("aborted with {:08X}h, {}", error.detail, text);
  } else {
    message += *error.text != '\0' ? error.text : name(error.code);
  }
  e["message"] = message;
  if (!fix.empty()) e["fix"] = fix;
  reply.status = status_of(error.code);
  reply.json = dump(json);
  reply.lines.clear();
  reply.error = error_line(message, fix);
  reply.cause = error;
}

void put_address(Json& json, const Identity& device) {
  json["address"] = to_string(device);
  json["type"] = nullptr;
  json["r_sn"] = nullptr;
  if (device.knows(0) && device.knows(1))
    json["type"] = fmt::format("0x{:08X}{:08X}", device.address.vendor, device.address.product);
  if (device.knows(2) && device.knows(3)) json["r_sn"] = fmt::format("0x{:016X}", device.r_sn().value());
}

}  // namespace berth::command
