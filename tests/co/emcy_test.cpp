// EMCY producer and consumer (docs/protocols/cia301.md §Emergencies; HC2.9).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "berth/co/emcy.hpp"
#include "wire.hpp"

using namespace berth;
using namespace berth::test;
namespace reg = berth::co::error_register;

namespace {

struct Emergencies : ::testing::Test, Bench {
  Emergencies() {
    producer.set_cob_id(co::CobId(0x85));
    producer.enable(true);
  }
  Log take() {
    run(50ms);
    return std::exchange(wire.log, {});
  }
  Station device{wire};
  co::EmcyProducer producer{device.dispatcher};
};

// "Error reset" 0000h only when the register goes to 0. One of several gone tells the newest that remains, with what it
// was told with: python-canopen and others take every 00xxh for "nothing is wrong any more".
TEST_F(Emergencies, ErrorResetOnlyWhenTheRegisterIsZero) {
  EXPECT_TRUE(producer.raise(0x8130, reg::communication, {1, 2, 3, 4, 5}));
  EXPECT_EQ(take(), (Log{"085#3081110102030405"}));
  EXPECT_TRUE(producer.raise(0x4210, reg::temperature));
  EXPECT_EQ(take(), (Log{"085#1042190000000000"}));
  EXPECT_EQ(producer.error_register(), 0x19);
  EXPECT_TRUE(producer.clear(0x8130));
  EXPECT_EQ(take(), (Log{"085#1042090000000000"}));
  EXPECT_TRUE(producer.clear(0x4210));
  EXPECT_EQ(take(), (Log{"085#0000000000000000"}));
  EXPECT_EQ(producer.error_register(), 0);
}

TEST_F(Emergencies, WhatRemainsIsToldWithItsOwnWords) {
  producer.raise(0x8130, reg::communication, {3}, 3);
  producer.raise(0x8130, reg::communication, {4}, 4);
  producer.raise(0x8210, reg::communication, {9, 8, 7, 6, 5});
  take();
  producer.clear(0x8130, {4}, 4);
  EXPECT_EQ(take(), (Log{"085#1082110908070605"})) << "the newest";
  producer.clear(0x8210);
  EXPECT_EQ(take(), (Log{"085#3081110300000000"})) << "node 3 is still away";
  producer.clear(0x8130, {3}, 3);
  EXPECT_EQ(take(), (Log{"085#0000000300000000"})) << "and here what is gone";
}

TEST_F(Emergencies, RaisedOnceClearedOnce) {
  EXPECT_TRUE(producer.raise(0x1000, reg::generic));
  EXPECT_FALSE(producer.raise(0x1000, reg::generic));
  EXPECT_FALSE(producer.clear(0x2000));
  EXPECT_TRUE(producer.clear(0x1000));
  EXPECT_FALSE(producer.clear(0x1000));
  EXPECT_FALSE(producer.raise(0x0000, 0)) << "00xxh is no error";
  EXPECT_FALSE(producer.raise(0x0081, 0));
  EXPECT_EQ(take().size(), 2U);
}

// 1015h: deferred in order, none lost, never early.
TEST_F(Emergencies, InhibitTimeDefersAndNeverDrops) {
  producer.set_inhibit(10ms);
  for (std::uint16_t code = 0x1001; code <= 0x1004; ++code) producer.raise(code, reg::generic);
  run(1s);
  ASSERT_EQ(wire.log.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(wire.log[i].substr(0, 8), "085#0" + std::to_string(i + 1) + "10");
  for (std::size_t i = 1; i < 4; ++i) EXPECT_GE(wire.times[i] - wire.times[i - 1], 10ms);
}

// Not in initialising and stopped; what happened there is told afterwards.
TEST_F(Emergencies, SilentWhileOff) {
  producer.enable(false);
  producer.raise(0x8130, reg::communication);
  EXPECT_TRUE(take().empty());
  EXPECT_EQ(producer.error_register(), reg::generic | reg::communication);
  producer.enable(true);
  EXPECT_EQ(take(), (Log{"085#3081110000000000"}));
  producer.reset();
  EXPECT_EQ(producer.error_register(), 0);
  producer.raise(0x8130, reg::communication);
  EXPECT_TRUE(take().empty()) << "off after a reset";
}

TEST_F(Emergencies, InvalidCobIdIsSilentAndExtendedWorks) {
  producer.set_cob_id(co::CobId(0x80000085));
  producer.raise(0x1000, reg::generic);
  EXPECT_TRUE(take().empty());
  producer.set_cob_id(co::CobId(0x20012345));
  EXPECT_EQ(take(), (Log{"00012345#0010010000000000"}));
}

TEST_F(Emergencies, FullPortIsTriedAgainAndALongQueueDropsTheOldest) {
  device.port.refuses = can::Queued::full;
  for (int i = 0; i < 12; ++i) {
    producer.raise(0x2000, reg::current);
    producer.clear(0x2000);
  }
  EXPECT_EQ(producer.dropped(), 24 - co::EmcyProducer::queue_size);
  run(20ms);
  EXPECT_TRUE(wire.log.empty());
  device.port.refuses.reset();
  const auto log = take();
  ASSERT_EQ(log.size(), co::EmcyProducer::queue_size);
  EXPECT_EQ(log.back(), "085#0000000000000000") << "the newest is kept";
}

// The register of every message is what is active at that moment; the last message of all is 0000h with 0.
RC_GTEST_PROP(EmcyProperty, RegisterFollowsTheActiveErrors, (std::vector<std::uint8_t> script)) {
  Bench b;
  Station device(b.wire);
  co::EmcyProducer producer(device.dispatcher);
  producer.set_cob_id(co::CobId(0x81));
  producer.enable(true);
  std::map<std::uint16_t, std::uint8_t> active;
  for (const auto byte : script) {
    const auto code = static_cast<std::uint16_t>(0x1000 + (byte & 0x1FU));
    const auto bits = static_cast<std::uint8_t>(1U << (byte & 7U));
    b.wire.log.clear();
    if ((byte & 0x80U) != 0) {
      RC_ASSERT(producer.clear(code) == (active.erase(code) == 1));
    } else {
      const bool fits = active.size() < co::EmcyProducer::most_errors && !active.contains(code);
      RC_ASSERT(producer.raise(code, bits) == fits);
      if (fits) active[code] = bits;
    }
    b.run(1ms);
    std::uint8_t expected = active.empty() ? 0 : 1;
    for (const auto& [c, r] : active) expected = static_cast<std::uint8_t>(expected | r);
    RC_ASSERT(producer.error_register() == expected);
    for (const auto& text : b.wire.log) {
      const auto frame = can::parse_frame(text);
      RC_ASSERT(frame->data[2] == expected);
      RC_ASSERT((frame->data[0] == 0 && frame->data[1] == 0) == (expected == 0));
      const auto told = static_cast<std::uint16_t>(frame->data[0] | frame->data[1] << 8U);
      RC_ASSERT(active.empty() || active.contains(told));
    }
  }
}

TEST(EmcyText, CodesAndClasses) {
  EXPECT_STREQ(co::emcy_text(0x8130), "life guard or heartbeat error");
  EXPECT_STREQ(co::emcy_text(0x0000), "error reset or no error");
  EXPECT_STREQ(co::emcy_text(0x0081), "one of several errors is gone");
  EXPECT_STREQ(co::emcy_text(0x2177), "current, device input side");
  EXPECT_STREQ(co::emcy_text(0x2777), "current");
  EXPECT_STREQ(co::emcy_text(0xFF01), "device specific");
  EXPECT_STREQ(co::emcy_text(0xB000), "unknown emergency code");
  for (unsigned code = 0; code <= 0xFFFF; ++code) ASSERT_NE(co::emcy_text(static_cast<std::uint16_t>(code)), nullptr);
}

// 1003h: newest first, the oldest drops out, no error resets.
TEST(ErrorField, NewestFirst) {
  co::ErrorField field;
  EXPECT_EQ(field.at(1), 0U);
  field.push({.code = 0x8130, .error_register = 0x11, .info = {0x34, 0x12, 9, 9, 9}});
  field.push({.code = 0x0000});
  field.push({.code = 0x0081});
  field.push({.code = 0x2310, .error_register = 0x02});
  EXPECT_EQ(field.count(), 2);
  EXPECT_EQ(field.at(1), 0x00002310U);
  EXPECT_EQ(field.at(2), 0x12348130U);
  EXPECT_EQ(field.at(3), 0U);
  for (std::uint16_t i = 0; i < 40; ++i) field.push({.code = static_cast<std::uint16_t>(0x1000 + i)});
  EXPECT_EQ(field.count(), co::ErrorField::size);
  EXPECT_EQ(field.at(1), 0x1027U);
  EXPECT_EQ(field.at(co::ErrorField::size), 0x1018U);
  field.clear();
  EXPECT_EQ(field.count(), 0);
}

struct Hearer final : co::EmcyConsumer::Observer {
  void emergency(NodeId node, const co::Emcy& m, rt::Time) noexcept override { heard.emplace_back(node.value(), m); }
  std::vector<std::pair<int, co::Emcy>> heard;
};

TEST(EmcyConsumer, HearsAllAndRemapped) {
  Bench b;
  Station station(b.wire), other(b.wire);
  Hearer hearer;
  co::EmcyConsumer consumer(station.dispatcher, hearer);
  consumer.hear_all();
  consumer.hear(NodeId(9), co::CobId(0x6D0));
  consumer.hear(NodeId(10), co::CobId(0x0C0));  // within the default range: one message, one event
  consumer.hear(NodeId(11), co::CobId());
  for (const char* f : {"085#3081110102030405", "6D0#0000000000000000", "0C0#1000010000000000", "085#308111", "085#R8",
                        "080#", "100#0000000000000000"}) {
    other.send(f);
  }
  b.run(10ms);
  ASSERT_EQ(hearer.heard.size(), 3U);
  std::ranges::sort(hearer.heard, {}, [](const auto& h) { return h.first; });
  EXPECT_EQ(hearer.heard[0].first, 5);
  EXPECT_EQ(hearer.heard[0].second, (co::Emcy{0x8130, 0x11, {1, 2, 3, 4, 5}}));
  EXPECT_EQ(hearer.heard[1].first, 9);
  EXPECT_EQ(hearer.heard[2].first, 10);
}

}  // namespace
