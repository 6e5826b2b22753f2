/// Topics of Sparkplug (Sparkplug 3.0 §4): `spBv1.0/GROUP/TYPE/EDGE[/DEVICE]` and `spBv1.0/STATE/HOST`.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "berth/base/result.hpp"

namespace berth::sparkplug {

constexpr std::string_view topic_namespace = "spBv1.0";

enum class MessageType : std::uint8_t { nbirth, ndeath, ndata, ncmd, dbirth, ddeath, ddata, dcmd, state };
/// "NBIRTH", ...
[[nodiscard]] const char* name(MessageType type) noexcept;
/// Those of a device, whose topic has its ID: DBIRTH, DDEATH, DDATA, DCMD.
[[nodiscard]] constexpr bool of_device(MessageType type) noexcept {
  return type >= MessageType::dbirth && type <= MessageType::dcmd;
}

/// Whether `id` may be a group, edge node, device or host ID: UTF-8, 1 to 1,024 bytes, none of + / # and no control
/// character. `invalid` with the reason, for the person who chose the name: it is never changed in silence. As the
/// standard, it sets no limit but the characters; the length is Berth's.
[[nodiscard]] Result<void> check_id(std::string_view id);

/// A group and an edge node: the standard's Edge Node Descriptor, unique in the infrastructure.
struct EdgeNodeId {
  std::string group;
  std::string node;
  friend auto operator<=>(const EdgeNodeId&, const EdgeNodeId&) = default;
};
/// As `check_id`; besides no group may be "STATE", whose topics would be those of hosts.
[[nodiscard]] Result<void> check(const EdgeNodeId& id);

struct Topic {
  MessageType type = MessageType::state;
  EdgeNodeId edge{};     ///< empty for `state`
  std::string device{};  ///< for messages of a device only
  std::string host{};    ///< for `state` only
  friend bool operator==(const Topic&, const Topic&) = default;
};

/// `not_found`: another namespace. `invalid`: ours, and not as the standard has it (the text says why).
[[nodiscard]] Result<Topic> parse_topic(std::string_view topic);

/// The topic of a message of an edge node. The IDs must have passed `check`; `type` is one of a node.
[[nodiscard]] std::string make_topic(const EdgeNodeId& edge, MessageType type);
/// The topic of a message of a device.
[[nodiscard]] std::string make_topic(const EdgeNodeId& edge, MessageType type, std::string_view device);
/// `spBv1.0/STATE/HOST`
[[nodiscard]] std::string state_topic(std::string_view host);

}  // namespace berth::sparkplug
