#include "berth/command/request.hpp"

#include <nlohmann/json.hpp>

#include "berth/command/json.hpp"

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

}  // namespace berth::command
