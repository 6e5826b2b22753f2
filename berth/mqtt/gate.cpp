#include "berth/mqtt/gate.hpp"

#include <algorithm>

namespace berth::mqtt {
namespace {

/// Reads a packet's body from its beginning. After the first piece that is not there, nothing is.
class Body {
 public:
  explicit Body(std::string_view bytes) noexcept : rest_(bytes) {}
  [[nodiscard]] bool good() const noexcept { return good_; }
  [[nodiscard]] bool is_at_end() const noexcept { return good_ && rest_.empty(); }
  void skip(std::size_t count) noexcept { static_cast<void>(take(count)); }
  std::string_view take(std::size_t count) noexcept {
    good_ = good_ && count <= rest_.size();
    if (!good_) return {};
    const auto taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }
  std::size_t number(std::size_t bytes) noexcept {
    std::size_t value = 0;
    for (const char c : take(bytes)) value = value << 8U | static_cast<unsigned char>(c);
    return value;
  }
  /// Two bytes of length, and as many bytes.
  void skip_string() noexcept { skip(number(2)); }
  /// A Variable Byte Integer (§1.5.5).
  std::size_t variable() noexcept {
    std::size_t value = 0;
    for (unsigned shift = 0; shift <= 21; shift += 7) {
      const std::size_t byte = number(1);
      value |= (byte & 127U) << shift;
      if (byte < 128) return value;
    }
    good_ = false;
    return 0;
  }
  void fail() noexcept { good_ = false; }

 private:
  std::string_view rest_;
  bool good_ = true;
};

// Table 2-4 of §2.2.2.2: the type of each property's value.
void skip_property(Body& body) noexcept {
  switch (body.variable()) {
    case 0x01:
    case 0x17:
    case 0x19:
    case 0x24:
    case 0x25:
    case 0x28:
    case 0x29:
    case 0x2A: return body.skip(1);
    case 0x13:
    case 0x21:
    case 0x22:
    case 0x23: return body.skip(2);
    case 0x02:
    case 0x11:
    case 0x18:
    case 0x27: return body.skip(4);
    case 0x0B: body.variable(); return;
    case 0x03:
    case 0x08:
    case 0x09:
    case 0x12:
    case 0x15:
    case 0x16:
    case 0x1A:
    case 0x1C:
    case 0x1F: return body.skip_string();
    case 0x26: body.skip_string(); return body.skip_string();
    default: return body.fail();
  }
}

void skip_properties(Body& body) noexcept {
  const std::size_t length = body.variable();
  Body properties(body.take(length));
  while (properties.good() && !properties.is_at_end()) skip_property(properties);
  if (!properties.good()) body.fail();
}

// MQTT 5 lets the code and the properties be left out where the code is 0.
bool is_code_and_properties(Body& body, bool v5) noexcept {
  if (body.is_at_end()) return true;
  if (!v5) return false;
  body.skip(1);
  if (!body.is_at_end()) skip_properties(body);
  return body.is_at_end();
}

// To a client of MQTT 5, a broker of 3.1.1 says in a CONNACK of its own that it does not know 5.
bool is_connack(Body& body, bool v5) noexcept {
  body.skip(2);
  if (v5 && !body.is_at_end()) skip_properties(body);
  return body.is_at_end();
}

bool is_publish(Body& body, unsigned qos, bool v5) noexcept {
  body.skip_string();
  if (qos == 1 && body.number(2) == 0) body.fail();
  if (v5) skip_properties(body);
  return body.good();
}

bool is_suback(Body& body, bool v5) noexcept {
  body.skip(2);
  if (v5) skip_properties(body);
  return body.good() && !body.is_at_end();
}

unsigned flags_of(unsigned head) noexcept { return head & 15U; }
unsigned qos_of(unsigned head) noexcept { return head >> 1U & 3U; }
PacketType type_of(unsigned head) noexcept { return static_cast<PacketType>(head >> 4U); }

/// The first byte of a packet.
bool is_head(unsigned head, bool v5) noexcept {
  switch (type_of(head)) {
    case PacketType::publish: return qos_of(head) <= 1;
    case PacketType::connack:
    case PacketType::puback:
    case PacketType::suback:
    case PacketType::pingresp: return flags_of(head) == 0;
    case PacketType::disconnect: return v5 && flags_of(head) == 0;
  }
  return false;
}

bool is_body(unsigned head, std::string_view bytes, bool v5) noexcept {
  Body body(bytes);
  switch (type_of(head)) {
    case PacketType::connack: return is_connack(body, v5);
    case PacketType::publish: return is_publish(body, qos_of(head), v5);
    case PacketType::puback: body.skip(2); return body.good() && is_code_and_properties(body, v5);
    case PacketType::suback: return is_suback(body, v5);
    case PacketType::pingresp: return body.is_at_end();
    case PacketType::disconnect: return is_code_and_properties(body, v5);
  }
  return false;
}

}  // namespace

void Gate::put(std::string_view bytes) {
  const std::size_t skipped = std::min(skip_, bytes.size());
  bytes.remove_prefix(skipped);
  skip_ -= skipped;
  bytes_.erase(0, taken_);
  taken_ = 0;
  bytes_ += bytes;
}

// Of QoS 1, the packet identifier behind the topic is waited for.
Gate::Next Gate::skip(std::string_view rest, std::size_t head, std::size_t length) {
  const auto first = static_cast<unsigned char>(rest.front());
  if (v5_ || type_of(first) != PacketType::publish) return tl::unexpected(Flaw::too_large);
  Incoming packet{.type = PacketType::publish, .skipped = true};
  if (qos_of(first) == 1) {
    Body body(rest.substr(head));
    const std::size_t topic = body.number(2);
    if (body.good() && 2 + topic + 2 > length) return tl::unexpected(Flaw::malformed);
    body.skip(topic);
    packet.id = static_cast<std::uint16_t>(body.number(2));
    if (!body.good()) return std::nullopt;
    if (packet.id == 0) return tl::unexpected(Flaw::malformed);
  }
  const std::size_t there = std::min(rest.size(), head + length);
  taken_ += there;
  skip_ = head + length - there;
  return packet;
}

Gate::Next Gate::next() {
  const auto rest = std::string_view(bytes_).substr(taken_);
  if (rest.empty()) return std::nullopt;
  const auto first = static_cast<unsigned char>(rest.front());
  if (!is_head(first, v5_)) return tl::unexpected(Flaw::malformed);
  std::size_t length = 0, head = 1;
  for (;; ++head) {
    if (head > 4) return tl::unexpected(Flaw::malformed);
    if (head == rest.size()) return std::nullopt;
    const auto byte = static_cast<unsigned char>(rest[head]);
    length |= std::size_t{byte & 127U} << 7U * (head - 1);
    if (byte < 128) break;
  }
  ++head;
  if (head + length > most_) return skip(rest, head, length);
  if (rest.size() < head + length) return std::nullopt;
  const Incoming packet{
      .type = type_of(first), .whole = rest.substr(0, head + length), .body = rest.substr(head, length)};
  if (!is_body(first, packet.body, v5_)) return tl::unexpected(Flaw::malformed);
  taken_ += packet.whole.size();
  return packet;
}

}  // namespace berth::mqtt
