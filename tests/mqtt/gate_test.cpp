// What a broker may send, and what never reaches libmosquitto.
#include "berth/mqtt/gate.hpp"

#include <gtest/gtest.h>

#include "../pch.hpp"

namespace berth::mqtt {
namespace {

using namespace std::string_literals;
using Flaw = Gate::Flaw;

struct Outcome {
  std::vector<std::string> packets{};
  std::optional<Flaw> flaw{};
};

// What comes through, if the bytes come in pieces of this size.
Outcome passed(const std::string& bytes, bool v5, std::size_t piece = 1, std::size_t most = 1'000) {
  Gate gate(v5, most);
  Outcome outcome;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    gate.put(std::string_view(bytes).substr(at, piece));
    for (;;) {
      const auto packet = gate.next();
      if (!packet) {
        outcome.flaw = packet.error();
        return outcome;
      }
      if (!*packet) break;
      outcome.packets.emplace_back((*packet)->whole);
    }
  }
  return outcome;
}

bool passes(const std::string& packet, bool v5) {
  const auto outcome = passed(packet, v5);
  return !outcome.flaw && outcome.packets == std::vector{packet};
}

// A PUBLISH of QoS 0 to "t" with these properties.
std::string with_properties(const std::string& properties) {
  const auto body = "\x00\x01t"s + static_cast<char>(properties.size()) + properties + "payload";
  return "\x30"s + static_cast<char>(body.size()) + body;
}

}  // namespace

TEST(MqttGate, WhatABrokerSends) {
  for (const auto& packet : {"\x20\x02\x00\x00"s, "\x20\x02\x01\x05"s, "\x30\x04\x00\x01tx"s, "\x31\x03\x00\x01t"s,
                             "\x3B\x06\x00\x01t\x00\x01x"s, "\x40\x02\x00\x01"s, "\x90\x03\x00\x01\x01"s,
                             "\x90\x04\x00\x01\x01\x80"s, "\xD0\x00"s})
    EXPECT_TRUE(passes(packet, false)) << testing::PrintToString(packet);
  for (const auto& packet :
       {"\x20\x03\x00\x00\x00"s, "\x20\x06\x00\x00\x03\x21\x00\x14"s, "\x30\x05\x00\x01t\x00x"s,
        "\x32\x07\x00\x01t\x00\x01\x00x"s, "\x40\x02\x00\x01"s, "\x40\x03\x00\x01\x10"s, "\x40\x04\x00\x01\x87\x00"s,
        "\x90\x04\x00\x01\x00\x01"s, "\xD0\x00"s, "\xE0\x00"s, "\xE0\x01\x8E"s, "\xE0\x02\x8B\x00"s,
        "\xE0\x07\x8B\x05\x1F\x00\x02no"s, "\x20\x02\x00\x01"s})  // a broker of 3.1.1 refuses 5
    EXPECT_TRUE(passes(packet, true)) << testing::PrintToString(packet);
}

TEST(MqttGate, WhatNoBrokerSends) {
  for (const bool v5 : {false, true}) {
    for (const auto& packet : {"\x10\x00"s,
                               "\x00\x00"s,
                               "\x50\x02\x00\x01"s,
                               "\x62\x02\x00\x01"s,
                               "\x70\x02\x00\x01"s,
                               "\x82\x03\x00\x01t"s,
                               "\xA2\x02\x00\x01"s,
                               "\xB0\x03\x00\x01\x00"s,
                               "\xC0\x00"s,
                               "\xF0\x00"s,  // types
                               "\x21\x02\x00\x00"s,
                               "\x41\x02\x00\x01"s,
                               "\x91\x03\x00\x01\x00"s,
                               "\xD1\x00"s,  // flags
                               "\x34\x06\x00\x01t\x00\x01x"s,
                               "\x36\x06\x00\x01t\x00\x01x"s,  // QoS 2 and 3
                               "\x20\x01\x00"s,
                               "\x30\x00"s,
                               "\x30\x02\x00\x01"s,
                               "\x30\x03\x00\x05t"s,
                               "\x32\x03\x00\x01t"s,
                               "\x32\x05\x00\x01t\x00\x00"s,  // the packet identifier 0
                               "\x40\x01\x00"s,
                               "\x90\x02\x00\x01"s,
                               "\xD0\x01\x00"s,
                               "\x30\xFF\xFF\xFF\xFF\x01"s})
      EXPECT_EQ(passed(packet, v5).flaw, Flaw::malformed) << v5 << testing::PrintToString(packet);
  }
  EXPECT_EQ(passed("\xE0\x00"s, false).flaw, Flaw::malformed) << "3.1.1 has no DISCONNECT from the broker";
  EXPECT_EQ(passed("\x40\x03\x00\x01\x10"s, false).flaw, Flaw::malformed);
}

// MQTT 5.0 §2.2.2: each property with a value of its type, and no other.
TEST(MqttGate, Properties) {
  for (const auto& property : {"\x01\x01"s,
                               "\x02\x00\x00\x00\x05"s,
                               "\x03\x00\x01x"s,
                               "\x08\x00\x00"s,
                               "\x09\x00\x02xy"s,
                               "\x0B\x80\x01"s,
                               "\x11\x00\x00\x00\x00"s,
                               "\x12\x00\x01x"s,
                               "\x13\x00\x3C"s,
                               "\x15\x00\x01x"s,
                               "\x16\x00\x01x"s,
                               "\x17\x01"s,
                               "\x18\x00\x00\x00\x01"s,
                               "\x19\x01"s,
                               "\x1A\x00\x01x"s,
                               "\x1C\x00\x01x"s,
                               "\x1F\x00\x01x"s,
                               "\x21\x00\x14"s,
                               "\x22\x00\x14"s,
                               "\x23\x00\x14"s,
                               "\x24\x01"s,
                               "\x25\x01"s,
                               "\x26\x00\x01k\x00\x01v"s,
                               "\x27\x00\x00\x01\x00"s,
                               "\x28\x01"s,
                               "\x29\x01"s,
                               "\x2A\x01"s}) {
    EXPECT_TRUE(passes(with_properties(property), true)) << testing::PrintToString(property);
    EXPECT_TRUE(passes(with_properties(property + property), true)) << testing::PrintToString(property);
    auto shorter = property;
    shorter.pop_back();
    EXPECT_EQ(passed(with_properties(shorter), true).flaw, Flaw::malformed) << testing::PrintToString(property);
  }
  // libmosquitto 2.0.11 would end the process.
  for (const int unknown : {0x00, 0x04, 0x07, 0x0A, 0x14, 0x20, 0x2B, 0x7F})
    EXPECT_EQ(passed(with_properties(std::string(1, static_cast<char>(unknown)) + "\x00\x00\x00"s), true).flaw,
              Flaw::malformed)
        << unknown;
  EXPECT_EQ(passed(with_properties("\x81\x80\x80\x80\x00"s), true).flaw, Flaw::malformed);
  EXPECT_EQ(passed("\x30\x04\x00\x01t\x05"s, true).flaw, Flaw::malformed) << "longer than the packet";
}

TEST(MqttGate, TheLimitIsLookedAtBeforeThePacketHasCome) {
  const auto packet = "\x30\x80\x01\x00\x01t\x00"s + std::string(124, 'x');  // 131 bytes
  EXPECT_EQ(passed(packet, true, 1, 131).packets.size(), 1U);
  EXPECT_EQ(passed(packet.substr(0, 2), true, 1, 130).flaw, std::nullopt);
  EXPECT_EQ(passed(packet.substr(0, 3), true, 1, 130).flaw, Flaw::too_large);
  EXPECT_EQ(passed("\x30\xFF\xFF\xFF\x7F"s, true).flaw, Flaw::too_large);
  EXPECT_EQ(passed("\x90\xFF\xFF\xFF\x7F"s, false).flaw, Flaw::too_large) << "only messages are skipped";
}

// A broker of 3.1.1 does not know the limit: a larger message is passed over, and the next packet is found behind it.
TEST(MqttGate, ALargerMessageIsSkipped) {
  const auto length = static_cast<char>(0x80 | (1'000 & 127));
  const auto large = [&](char first, const std::string& begin) {
    return first + std::string(1, length) + "\x07" + begin + std::string(1'000 - begin.size(), '\xD0');
  };
  for (const std::size_t piece : {1U, 7U, 2'000U}) {
    for (const auto& [packet, id] :
         {std::pair(large('\x30', "\x00\x01t"s), 0), std::pair(large('\x3B', "\x00\x01t\x12\x34"s), 0x1234)}) {
      Gate gate(false, 100);
      std::vector<Incoming> came;
      const auto all = packet + "\xD0\x00"s + packet + "\x40\x02\x00\x01"s;
      for (std::size_t at = 0; at < all.size(); at += piece) {
        gate.put(std::string_view(all).substr(at, piece));
        for (;;) {
          const auto next = gate.next();
          ASSERT_TRUE(next);
          if (!*next) break;
          came.push_back(**next);
        }
      }
      ASSERT_EQ(came.size(), 4U);
      for (const std::size_t i : {0U, 2U}) {
        EXPECT_TRUE(came[i].skipped);
        EXPECT_EQ(came[i].id, id);
      }
      EXPECT_EQ(came[1].type, PacketType::pingresp);
      EXPECT_EQ(came[3].type, PacketType::puback);
    }
  }
  EXPECT_EQ(passed(large('\x32', "\x00\x01t\x00\x00"s), false, 1, 100).flaw, Flaw::malformed);
}

// Something else than a broker is noticed by its first byte, and not when it has said enough.
TEST(MqttGate, TheFirstByteIsLookedAtByItself) {
  for (const auto& other : {"HTTP/1.1 400"s, "SSH-2.0-"s, "\x15\x03\x01"s, "* OK"s})
    EXPECT_EQ(passed(other.substr(0, 1), true).flaw, Flaw::malformed) << other;
}

RC_GTEST_PROP(MqttGate, TheSizeOfPiecesDoesNotMatter, ()) {
  std::string all;
  const auto packets = *rc::gen::container<std::vector<std::string>>(
      rc::gen::elementOf(std::vector{"\xD0\x00"s, "\x40\x02\x00\x01"s, "\x30\x08\x00\x01t\x00payl"s,
                                     "\x30\xC8\x01\x00\x01t\x00"s + std::string(196, 'x'), "\x20\x03\x00\x00\x00"s}));
  for (const auto& packet : packets) all += packet;
  const auto outcome = passed(all, true, *rc::gen::inRange<std::size_t>(1, 300));
  RC_ASSERT(!outcome.flaw);
  RC_ASSERT(outcome.packets == packets);
}

}  // namespace berth::mqtt
