/// What a broker sends, packet by packet, before libmosquitto sees it: whole, within the limit, of a kind that a broker
/// may send to this client, and with properties that MQTT 5 has. Pure; internal to room `mqtt`.
///
/// libmosquitto sets a packet's memory aside before it has come, up to 256 MB, and Debian 12's (2.0.11) ends the whole
/// process at a property that it does not know.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace berth::mqtt {

/// Types of packets that a broker sends to a client of QoS 0 and 1 (MQTT 5.0 §2.1.2).
enum class PacketType : std::uint8_t {
  connack = 2,
  publish = 3,
  puback = 4,
  suback = 9,
  pingresp = 13,
  disconnect = 14
};

struct Incoming {
  PacketType type = PacketType::connack;
  std::string_view whole{};  ///< as it came
  std::string_view body{};   ///< without its fixed header
  bool skipped = false;      ///< a PUBLISH beyond the limit: nothing of it is kept
  std::uint16_t id = 0;      ///< of a skipped one of QoS 1, which is to be acknowledged; else 0
};

class Gate {
 public:
  enum class Flaw : std::uint8_t {
    too_large,  ///< a packet beyond the limit, which no broker should send
    malformed   ///< no packet that a broker may send here
  };

  /// `most`: bytes of a packet. `v5`: packets have properties, and the broker knows `most`; else they are those of
  /// 3.1.1, and a larger PUBLISH is skipped.
  Gate(bool v5, std::size_t most) noexcept : v5_(v5), most_(most) {}

  void put(std::string_view bytes);
  /// The next packet, valid until the next call of `put`; empty: it has not come as a whole. After a flaw nothing more
  /// comes.
  [[nodiscard]] tl::expected<std::optional<Incoming>, Flaw> next();

 private:
  using Next = tl::expected<std::optional<Incoming>, Flaw>;
  [[nodiscard]] Next skip(std::string_view rest, std::size_t head, std::size_t length);

  bool v5_;
  std::size_t most_;
  std::string bytes_;
  std::size_t taken_ = 0;  // of bytes_
  std::size_t skip_ = 0;   // bytes still to come of a skipped packet
};

}  // namespace berth::mqtt
