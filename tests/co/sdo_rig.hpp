// What the tests of SDO block transfer and streams share.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/co/sdo_server.hpp"
#include "dictionary.hpp"
#include "wire.hpp"

namespace berth::test {

using Bytes = std::vector<std::uint8_t>;

// Bit by bit from the standard's words, so that a mistake in the product's tables shows: x^16 + x^12 + x^5 + 1.
inline std::uint16_t slow_crc(const Bytes& bytes) {
  unsigned crc = 0;
  for (const auto byte : bytes) {
    for (int bit = 7; bit >= 0; --bit) {
      const bool out = ((crc >> 15U) & 1U) != ((byte >> bit) & 1U);
      crc = (crc << 1U) & 0xFFFFU;
      if (out) crc ^= 0x1021U;
    }
  }
  return static_cast<std::uint16_t>(crc);
}

inline std::string hex(const Bytes& bytes) {
  static constexpr char digits[] = "0123456789ABCDEF";
  std::string text;
  for (const auto byte : bytes) text += {digits[byte >> 4U], digits[byte & 15U]};
  return text;
}
inline std::string le16(unsigned value) {
  return hex({static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8U)});
}

inline Bytes numbers(std::size_t count, std::size_t from = 0) {
  Bytes bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>((i + from) * 37 + ((i + from) >> 8U));
  return bytes;
}

// The frames of a sub-block as the standard has them: number 1.., bit 7 in the last, seven bytes each.
inline std::vector<std::string> segments_of(const Bytes& data, bool last_of_all = true) {
  std::vector<std::string> frames;
  const std::size_t count = std::max<std::size_t>(1, (data.size() + 6) / 7);
  for (std::size_t i = 0; i < count; ++i) {
    Bytes frame(8);
    frame[0] = static_cast<std::uint8_t>((i + 1) | (last_of_all && i + 1 == count ? 0x80U : 0U));
    for (std::size_t k = 0; k < 7 && i * 7 + k < data.size(); ++k) frame[k + 1] = data[i * 7 + k];
    frames.push_back(hex(frame));
  }
  return frames;
}

// A server alone: requests and answers as hex.
struct ServerRig {
  explicit ServerRig(std::size_t buffer = 4096) : values(test_description(), NodeId(5)), server(values, buffer) {
    server.set_response_id(co::CobId(0x585));
  }
  std::string ask(const std::string& data) {
    const auto answer = answer_of(server, *can::parse_frame("605#" + data));
    return answer ? can::to_string(*answer).substr(4) : "";
  }
  // All segments that the server has to send now.
  std::vector<std::string> segments() {
    std::vector<std::string> frames;
    can::Frame frame;
    frame.size = 8;
    while (server.sending()) {
      server.segments().segment(frame);
      server.segments().advance();
      frames.push_back(can::to_string(frame).substr(4));
    }
    server.segments().confirm();
    return frames;
  }
  Bytes stored(std::uint16_t index) {
    const auto bytes = values.bytes(ObjectRef{index, 0});
    return {bytes.begin(), bytes.end()};
  }
  od::Values values;
  co::SdoServer server;
};

// Makes bytes as they are asked for and checks them as they come: no memory, however long. Both ends of a transfer.
struct Pattern final : od::Stream, co::SdoSource, co::SdoSink {
  static std::uint8_t at(std::size_t i) { return static_cast<std::uint8_t>(i * 131 + (i >> 8U) * 7 + (i >> 16U)); }
  void fill(std::span<std::uint8_t> into) {
    for (auto& byte : into) byte = at(position++);
  }
  od::AbortCode check(std::span<const std::uint8_t> bytes) {
    largest = std::max(largest, bytes.size());
    for (const auto byte : bytes) wrong += byte != at(position++) ? 1 : 0;
    return position > refuse_from ? od::AbortCode::hardware : od::AbortCode::none;
  }
  od::Answer<std::size_t> give(std::span<std::uint8_t> into) {
    const auto count = std::min(into.size(), length - position);
    if (position + count > refuse_from) return od::refuse(od::AbortCode::hardware);
    fill(into.first(count));
    return count;
  }
  // od::Stream
  od::Answer<std::optional<std::size_t>> open_read(ObjectRef) noexcept override {
    ++opened;
    position = 0;
    return sized ? std::optional(promised.value_or(length)) : std::nullopt;
  }
  od::AbortCode open_write(ObjectRef, std::optional<std::size_t> size) noexcept override {
    if (on_open == od::AbortCode::none || on_open == od::AbortCode::pending) ++opened;
    position = 0;
    told = size;
    return on_open;
  }
  od::AbortCode close(ObjectRef, bool complete) noexcept override {
    ++closed;
    completed = complete;
    return on_close;
  }
  // od::Stream and SdoSource, od::Stream and SdoSink
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override { return give(into); }
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override { return check(bytes); }
  // SdoSource
  std::optional<std::size_t> size() const noexcept override {
    return sized ? std::optional(promised.value_or(length)) : std::nullopt;
  }
  bool rewind() noexcept override {
    position = 0;
    ++rewound;
    return can_rewind;
  }
  // SdoSink
  od::AbortCode begin(std::optional<std::size_t> size) noexcept override {
    told = size;
    position = 0;
    return on_open;
  }

  std::size_t length = 0;
  std::size_t position = 0;
  std::size_t wrong = 0;
  std::size_t largest = 0;
  std::size_t refuse_from = SIZE_MAX;
  std::optional<std::size_t> told;
  std::optional<std::size_t> promised;  // what it says, if that is not the truth
  od::AbortCode on_open = od::AbortCode::none;
  od::AbortCode on_close = od::AbortCode::none;
  int opened = 0, closed = 0, rewound = 0;
  bool completed = false;
  bool sized = true;
  bool can_rewind = true;
};

}  // namespace berth::test
