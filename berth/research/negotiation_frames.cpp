#include "berth/research/negotiation_frames.hpp"

#include <array>

namespace berth::research {
namespace {

constexpr std::uint32_t reserved_bits = can::extended_mask & ~0x1FFFU;
constexpr unsigned code_request = 1;
constexpr unsigned code_used = 2;
constexpr unsigned code_identity = 0x10;  // and above

std::string hex(unsigned value) {
  constexpr std::array digits{'0', '1', '2', '3', '4', '5', '6', '7', '8', '9', 'a', 'b', 'c', 'd', 'e', 'f'};
  std::string text = "0x";
  if (value > 0xF) text += digits.at(value >> 4U & 0xFU);
  return text + digits.at(value & 0xFU);
}

}  // namespace

can::Frame request_used() noexcept { return can::Frame::ext(request_used_id, {}); }

can::Frame used(NodeId id) noexcept { return can::Frame::ext(used_id | id.value(), {}); }

can::Frame identity(const LssAddress& address, unsigned byte) noexcept {
  return can::Frame::ext(identity_id | byte % identity_bytes << 8U | identity_byte(address, byte), {});
}

std::optional<NegotiationMessage> decode_negotiation(const can::Frame& frame) noexcept {
  if (!frame.extended || frame.remote || frame.fd || frame.size != 0) return std::nullopt;
  if ((frame.id & reserved_bits) != 0) return std::nullopt;
  const unsigned code = frame.id >> 8U;
  const auto field = static_cast<std::uint8_t>(frame.id);
  NegotiationMessage message;
  if (code >= code_identity) {
    message.kind = NegotiationMessage::Kind::identity;
    message.byte = static_cast<std::uint8_t>(code - code_identity);
    message.value = field;
    return message;
  }
  if (code == code_request && field == 0) return message;
  if (code != code_used || field < 1 || field > 127) return std::nullopt;
  message.kind = NegotiationMessage::Kind::used;
  message.node = NodeId(field);
  return message;
}

std::string interpretation(const NegotiationMessage& message) {
  switch (message.kind) {
    case NegotiationMessage::Kind::request_used: return "Request used node-IDs";
    case NegotiationMessage::Kind::used: return "Used node-ID: " + hex(message.node.value());
    case NegotiationMessage::Kind::identity: break;
  }
  return "sub: " + std::to_string(message.byte / 4 + 1) + ", byte: " + std::to_string(message.byte % 4) +
         ", value: " + hex(message.value);
}

}  // namespace berth::research
