/// The frame protocol between a plant's process and its clients: one message per packet of a Unix SEQPACKET socket,
/// numbers little-endian. Each client is one node on one bus.
///
///     client to server                              server to client
///     'H' hello     version U8 = 2, bus name        'W' welcome   status: the node is on the bus
///     'S' send      tag U32, frame                  'E' refused   text, then the connection ends
///     'X' withdraw  tag U32                         'r' received  frame
///     'L' listen    n x (first U32, last U32)       's' sent      tag U32: acknowledged on the wire
///     'R' restart   bit rate U32                    'q' not sent  tag U32, reason U8 (`can::Queued`)
///                                                   'c' changed   status
///     frame  = key U32 (bit 31: extended), flags U8 (1: remote), size U8, data 0..8
///     status = bit rate U32, tec U16, rec U16, errors U32, flags U8 (1 listen only, 2 bus-off, 4 up, 8 knows counters,
///     16 knows sent, 32 knows errors)
///
/// The server also sends a controller's status: 'c' when its state changed, before a frame when errors came before it,
/// and at least every `status_period` while counters change.
///
/// An end that receives an invalid message closes the connection. Order is kept: a node's messages come in the order of
/// the events on the wire.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "berth/can/port.hpp"

namespace berth::io {

inline constexpr std::uint8_t plant_protocol_version = 2;
inline constexpr rt::Duration status_period = std::chrono::milliseconds(20);
inline constexpr std::size_t most_ranges = 512;  ///< of one 'L'
inline constexpr std::size_t most_text = 256;    ///< of a bus name or an 'E'
inline constexpr std::size_t longest_message = 1 + most_ranges * 8;

enum class MessageKind : char {
  hello = 'H',
  send = 'S',
  withdraw = 'X',
  listen = 'L',
  restart = 'R',
  welcome = 'W',
  refused = 'E',
  received = 'r',
  sent = 's',
  not_sent = 'q',
  changed = 'c',
};

/// Any message; only the fields of its kind are meaningful.
struct Message {
  MessageKind kind = MessageKind::hello;
  std::string text{};                        ///< hello: bus; refused: why
  std::uint32_t tag = 0;                     ///< send, withdraw, sent, not_sent
  std::uint32_t number = 0;                  ///< restart: bit rate, bit/s
  can::Frame frame{};                        ///< send, received
  can::Queued reason = can::Queued::closed;  ///< not_sent
  can::Status status{};                      ///< welcome, changed; without `queued`
  std::vector<can::IdRange> ranges{};        ///< listen; at most `most_ranges`
};

/// The packet. Longer texts and more ranges than allowed are cut.
[[nodiscard]] std::vector<std::uint8_t> encode(const Message& message);
/// Empty when the bytes are not exactly one message.
[[nodiscard]] std::optional<Message> decode(std::span<const std::uint8_t> packet);

}  // namespace berth::io
