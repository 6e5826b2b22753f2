#include "berth/command/request.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/command/reply.hpp"

namespace berth::command {

std::string to_json(const Request& request) {
  Json json;
  json["verb"] = request.verb;
  json["arguments"] = Json::object();
  for (const auto& [key, value] : request.arguments) json["arguments"][key] = value;
  if (request.progress) json["progress"] = true;
  return dump(json);
}

Request parse_request(const std::string& line, std::string& error) {
  Request request;
  const auto json = Json::parse(line, nullptr, false);
  const auto no = [&](const char* why) {
    error = why;
    return Request{};
  };
  if (!json.is_object()) return no("a request is one JSON object on one line");
  for (const auto& [key, value] : json.items()) {
    if (key == "verb" && value.is_string()) {
      request.verb = value.get<std::string>();
    } else if (key == "arguments" && value.is_object()) {
      for (const auto& [name, text] : value.items()) {
        if (!text.is_string()) return no("every argument is a string");
        request.arguments[name] = text.get<std::string>();
      }
    } else if (key == "progress" && value.is_boolean()) {
      request.progress = value.get<bool>();
    } else {
      return no("a request has \"verb\", a string, and \"arguments\", an object of strings");
    }
  }
  if (request.verb.empty()) return no("the request has no verb");
  error.clear();
  return request;
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
