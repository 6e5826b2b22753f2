#include "berth/command/reply.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/od/abort_code.hpp"
#include "berth/text/printable.hpp"

namespace berth::command {

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

std::string to_json(const Reply& reply) {
  Json json;
  json["status"] = reply.status;
  json["reply"] = Json::parse(reply.json, nullptr, false);
  json["lines"] = reply.lines;
  json["error"] = reply.error;
  return dump(json);
}

std::string progress_json(const std::string& line) {
  Json json;
  json["progress"] = line;
  return dump(json);
}

std::optional<std::string> parse_progress(const std::string& line) {
  const auto json = Json::parse(line, nullptr, false);
  const bool is = json.is_object() && json.size() == 1 && json.contains("progress") && json["progress"].is_string();
  return is ? std::optional(json["progress"].get<std::string>()) : std::nullopt;
}

Reply parse_reply(const std::string& line) {
  const auto json = Json::parse(line, nullptr, false);
  const bool good = json.is_object() && json.contains("status") && json["status"].is_number_integer() &&
                    json.contains("reply") && json["reply"].is_object() && json.contains("lines") &&
                    json["lines"].is_array() && json.contains("error") && json["error"].is_string() &&
                    std::ranges::all_of(json["lines"], [](const auto& l) { return l.is_string(); });
  if (!good) return refusal(3, "the running `berth up` answered something that is not a reply");
  Reply reply;
  reply.status = json["status"].get<int>();
  reply.json = dump(json["reply"]);
  reply.lines = json["lines"].get<std::vector<std::string>>();
  reply.error = json["error"].get<std::string>();
  return reply;
}

Reply refusal(int status, std::string message) {
  Reply reply;
  refuse(reply, status, message);
  return reply;
}

}  // namespace berth::command
