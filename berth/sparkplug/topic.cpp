#include "berth/sparkplug/topic.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "berth/sparkplug/value.hpp"

namespace berth::sparkplug {
namespace {

constexpr std::array message_names{"NBIRTH", "NDEATH", "NDATA", "NCMD", "DBIRTH", "DDEATH", "DDATA", "DCMD", "STATE"};
constexpr std::size_t longest_id = 1024;

std::vector<std::string_view> levels(std::string_view topic) {
  std::vector<std::string_view> out;
  for (std::size_t begin = 0; out.size() <= 5;) {  // more than five is too many anyway
    const auto end = topic.find('/', begin);
    out.push_back(topic.substr(begin, end - begin));
    if (end == std::string_view::npos) break;
    begin = end + 1;
  }
  return out;
}

Result<Topic> state(std::string_view host) {
  if (const auto legal = check_id(host); !legal) return fail(legal.error());
  return Topic{.type = MessageType::state, .edge = {}, .device = {}, .host = std::string(host)};
}

}  // namespace

const char* name(MessageType type) noexcept { return message_names[static_cast<std::size_t>(type)]; }

Result<void> check_id(std::string_view id) {
  if (id.empty()) return fail(Errc::invalid, "a Sparkplug ID may not be empty");
  if (id.size() > longest_id) return fail(Errc::invalid, "a Sparkplug ID may have 1,024 bytes at most here");
  if (id.find('/') != std::string_view::npos) {
    return fail(Errc::invalid, "a Sparkplug ID may not contain /, which separates the levels of a topic");
  }
  if (id.find_first_of("+#") != std::string_view::npos) {
    return fail(Errc::invalid, "a Sparkplug ID may not contain + or #, the wildcards of MQTT");
  }
  if (std::ranges::any_of(id, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; })) {
    return fail(Errc::invalid, "a Sparkplug ID may not contain control characters");
  }
  if (!is_utf8(id)) return fail(Errc::invalid, "a Sparkplug ID must be UTF-8");
  return {};
}

Result<void> check(const EdgeNodeId& id) {
  if (id.group == "STATE") {
    return fail(Errc::invalid, "a group may not be called STATE: its topics would be those of host applications");
  }
  if (const auto legal = check_id(id.group); !legal) return legal;
  return check_id(id.node);
}

Result<Topic> parse_topic(std::string_view topic) {
  const auto parts = levels(topic);
  if (parts[0] != topic_namespace) return fail(Errc::not_found, "the topic is not of Sparkplug B");
  if (parts.size() == 3 && parts[1] == "STATE") return state(parts[2]);
  if (parts.size() < 4 || parts.size() > 5) return fail(Errc::invalid, "a Sparkplug topic has four or five levels");
  const auto found = std::ranges::find(message_names, parts[2]);
  const auto type = static_cast<MessageType>(found - message_names.begin());
  if (found == message_names.end() || type == MessageType::state) {
    return fail(Errc::invalid, "the topic's third level is no message type of Sparkplug");
  }
  if (of_device(type) != (parts.size() == 5)) {
    return fail(Errc::invalid, of_device(type) ? "this message type needs a device ID in its topic"
                                               : "this message type may have no device ID in its topic");
  }
  Topic out{.type = type, .edge = {std::string(parts[1]), std::string(parts[3])}, .device = {}, .host = {}};
  if (const auto legal = check(out.edge); !legal) return fail(legal.error());
  if (!of_device(type)) return out;
  if (const auto legal = check_id(parts[4]); !legal) return fail(legal.error());
  out.device = parts[4];
  return out;
}

std::string make_topic(const EdgeNodeId& edge, MessageType type) {
  return std::string(topic_namespace) + "/" + edge.group + "/" + name(type) + "/" + edge.node;
}

std::string make_topic(const EdgeNodeId& edge, MessageType type, std::string_view device) {
  return make_topic(edge, type) + "/" + std::string(device);
}

std::string state_topic(std::string_view host) { return std::string(topic_namespace) + "/STATE/" + std::string(host); }

}  // namespace berth::sparkplug
