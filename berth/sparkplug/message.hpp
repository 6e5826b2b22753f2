/// What passes between a protocol machine of this room and the MQTT connection that its owner keeps.
///
/// `EdgeNode` and `Host` have no connection, thread or clock. Their owner tells them what happened (connected, a
/// message came, time passed) and gets what to do through an `Outbox`.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {

/// Now, by two clocks. What is written into messages is `utc`; what is waited for goes by `steady`, which no person
/// sets and which never goes back.
struct Now {
  Utc utc;
  std::chrono::milliseconds steady{0};
};

/// A message to be published, also as a will.
struct Publication {
  std::string topic;
  Bytes bytes;
  std::uint8_t qos = 0;
  bool retain = false;
};

/// A message that came. `retained`: the broker had kept it, it is not new.
struct Incoming {
  std::string_view topic;
  std::span<const std::uint8_t> bytes;
  bool retained = false;
};

/// Implemented by the owner of the connection. It must do these in the order in which they are called, and must not
/// call back from within.
class Outbox {
 public:
  virtual void publish(Publication message) = 0;
  virtual void subscribe(const std::string& filter, std::uint8_t qos) = 0;
  /// Find out whether the broker has all that was published until now: send it some request that it answers (PINGREQ,
  /// or SUBSCRIBE to a topic that is subscribed anyway), and call `answered(mark)` at the answer. MQTT keeps the order
  /// of a connection, so the answer proves that what was sent before came. Messages of QoS 0 are proven by nothing
  /// else.
  virtual void probe(std::uint64_t mark) = 0;
  /// Send DISCONNECT after what was published, so that the broker drops the will. `disconnected` is to be called at the
  /// end, as of any other connection.
  virtual void disconnect() = 0;

 protected:
  ~Outbox() = default;
};

}  // namespace berth::sparkplug
