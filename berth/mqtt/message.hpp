/// What goes to a broker and comes from it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/mqtt/options.hpp"

namespace berth::mqtt {

/// Counts the connections of a client from 1 on; 0: none.
using ConnectionNumber = std::uint64_t;
/// Counts the accepted messages of a client from 1 on.
using MessageId = std::uint64_t;

enum class Need : std::uint8_t {
  must,  ///< refused only when there is no room at all: whoever publishes it keeps it (store and forward)
  may    ///< refused earlier, so that room is left for what must be sent
};

struct Message {
  ConnectionNumber connection = 0;  ///< the one that it is for: on another it would be out of order
  std::string topic{};              ///< without wildcards
  std::vector<std::uint8_t> payload{};
  Qos qos = Qos::at_most_once;
  bool retain = false;
  Need need = Need::must;
};

/// What the broker publishes when the connection breaks (MQTT 5.0 §3.1.2.5).
struct Will {
  std::string topic{};
  std::vector<std::uint8_t> payload{};
  Qos qos = Qos::at_least_once;
  bool retain = false;
};

/// Why a message was not accepted.
enum class Refusal : std::uint8_t {
  not_connected,  ///< the connection that it is for is over, or not there yet
  no_room,        ///< too much waits already (`Limits`)
  too_large,      ///< for the broker's Maximum Packet Size, or for MQTT
  wrong_topic,    ///< empty, too long, with a wildcard or a NUL
};
[[nodiscard]] const char* name(Refusal refusal) noexcept;

/// What a client has counted since its start.
struct Counts {
  std::uint64_t accepted = 0;
  std::uint64_t no_room_must = 0;
  std::uint64_t no_room_may = 0;
  std::uint64_t incoming_dropped = 0;  ///< messages over `Limits::incoming`
  std::size_t waiting = 0;             ///< now: messages not yet sent or acknowledged
  std::size_t waiting_bytes = 0;       ///< now: of their topics and payloads
};

}  // namespace berth::mqtt
