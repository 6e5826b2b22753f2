#include "berth/studio/messages.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>

namespace berth::studio {
namespace {

using Plain = nlohmann::json;
using Read = tl::expected<Message, std::string>;

tl::unexpected<std::string> no(std::string why) { return tl::unexpected(std::move(why)); }

/// The keys of one message. Each is asked for once; a key that nobody asked for is an error.
class Keys {
 public:
  explicit Keys(const Plain& json) : json_(&json) {}

  [[nodiscard]] std::optional<std::string> text(const char* key) {
    const Plain* const value = find(key);
    return value != nullptr && value->is_string() ? std::optional(value->get<std::string>()) : std::nullopt;
  }
  [[nodiscard]] std::optional<std::uint64_t> number(const char* key) {
    const Plain* const value = find(key);
    return value != nullptr && value->is_number_unsigned() ? std::optional(value->get<std::uint64_t>()) : std::nullopt;
  }
  [[nodiscard]] std::optional<bool> flag(const char* key) {
    const Plain* const value = find(key);
    return value != nullptr && value->is_boolean() ? std::optional(value->get<bool>()) : std::nullopt;
  }
  [[nodiscard]] const Plain* find(const char* key) {
    const auto it = json_->find(key);
    if (it == json_->end()) return nullptr;
    ++asked_;
    return &*it;
  }
  [[nodiscard]] bool has(const char* key) const { return json_->contains(key); }
  [[nodiscard]] bool all_asked() const { return asked_ == json_->size(); }

 private:
  const Plain* json_;
  std::size_t asked_ = 0;
};

tl::expected<command::Request, std::string> read_request(Keys& keys) {
  command::Request request;
  const auto verb = keys.text("verb");
  if (!verb || verb->empty()) return no("a request has \"verb\", a string");
  request.verb = *verb;
  const Plain* const arguments = keys.find("arguments");
  if (arguments == nullptr) return request;
  if (!arguments->is_object()) return no("\"arguments\" is an object of strings");
  for (const auto& [name, value] : arguments->items()) {
    if (!value.is_string()) return no("every argument is a string");
    request.arguments[name] = value.get<std::string>();
  }
  return request;
}

Read read_frames(Keys& keys, Message message) {
  const auto count = keys.number("count");
  if (!count || *count < 1 || *count > most_rows) return no(fmt::format("\"count\" is 1 to {}", most_rows));
  message.count = static_cast<unsigned>(*count);
  if (keys.has("from")) {
    message.from = keys.number("from");
    if (!message.from) return no("\"from\" is the number of a frame");
  }
  if (keys.has("filter")) {
    auto filter = keys.text("filter");
    if (!filter || filter->size() > longest_filter)
      return no(fmt::format("\"filter\" is a string of at most {} bytes", longest_filter));
    message.filter = std::move(*filter);
  }
  return message;
}

Read read_kind(const std::string& type, Keys& keys) {
  Message message;
  if (type == "lock") return message;
  if (type == "live") {
    message.kind = MessageKind::live;
    const auto on = keys.flag("frames");
    if (!on) return no("\"live\" has \"frames\", true or false");
    message.on = *on;
    return message;
  }
  if (type == "unlock") {
    message.kind = MessageKind::unlock;
    const auto minutes = keys.number("minutes");
    if (!minutes || *minutes < 1 || *minutes > most_minutes)
      return no(fmt::format("\"minutes\" is 1 to {}", most_minutes));
    message.minutes = static_cast<unsigned>(*minutes);
    return message;
  }
  if (type != "request" && type != "frames") return no("\"type\" is request, frames, live, unlock or lock");
  auto id = keys.text("id");
  if (!id || id->empty() || id->size() > longest_id)
    return no(fmt::format("\"id\" is a string of 1 to {} bytes", longest_id));
  message.id = std::move(*id);
  message.kind = type == "request" ? MessageKind::request : MessageKind::frames;
  if (message.kind == MessageKind::frames) return read_frames(keys, std::move(message));
  auto request = read_request(keys);
  if (!request) return no(request.error());
  message.request = std::move(*request);
  return message;
}

}  // namespace

Read parse_message(std::string_view text) {
  if (text.size() > longest_message) return no("a message has at most 65,536 bytes");
  const Plain json = Plain::parse(text, nullptr, false);
  if (!json.is_object()) return no("a message is one JSON object");
  Keys keys(json);
  const auto type = keys.text("type");
  if (!type) return no("a message has \"type\", a string");
  auto read = read_kind(*type, keys);
  if (read && !keys.all_asked()) return no(fmt::format("\"{}\" has an unknown key", *type));
  return read;
}

tl::expected<command::Request, std::string> parse_body(std::string_view text) {
  if (text.size() > longest_message) return no("a request has at most 65,536 bytes");
  const Plain json = Plain::parse(text, nullptr, false);
  if (!json.is_object()) return no("a request is one JSON object");
  Keys keys(json);
  auto read = read_request(keys);
  if (read && !keys.all_asked()) return no("a request has \"verb\" and \"arguments\", and no other key");
  return read;
}

}  // namespace berth::studio
