// What the files of a machine say of a bus's messages.
#include "berth/traffic/bus_messages.hpp"

#include <algorithm>

#include "berth/od/description.hpp"
#include "tests/pch.hpp"

namespace berth::traffic {
namespace {

using namespace std::chrono_literals;
using od::DataType;
using od::Literal;

// TPDO 1 of 2000h (16 bits) and 2001h (8 bits), with this transmission type, inhibit time and event timer.
struct Tpdo {
  unsigned type = 255;
  unsigned inhibit_100us = 0;
  unsigned timer_ms = 0;
  std::uint32_t cob_id = 0x180;  // and the node-ID
};

std::shared_ptr<const od::Description> device_with(const Tpdo& tpdo, std::uint32_t sync_period_us = 0) {
  od::DescriptionBuilder b;
  b.variable(0x1005,
             {.type = DataType::unsigned32, .initial = Literal::number(sync_period_us == 0 ? 0x80 : 0x4000'0080)});
  b.variable(0x1006, {.type = DataType::unsigned32, .initial = Literal::number(sync_period_us)});
  b.variable(0x2000, {.name = "Position", .type = DataType::unsigned16, .mappable = true});
  b.variable(0x2001, {.name = "State", .type = DataType::unsigned8, .mappable = true});
  b.object(0x1800, od::ObjectCode::record, "TPDO 1");
  b.sub(0x1800, {.sub = 1, .type = DataType::unsigned32, .initial = Literal::node_id_plus(tpdo.cob_id)});
  b.sub(0x1800, {.sub = 2, .type = DataType::unsigned8, .initial = Literal::number(tpdo.type)});
  b.sub(0x1800, {.sub = 3, .type = DataType::unsigned16, .initial = Literal::number(tpdo.inhibit_100us)});
  b.sub(0x1800, {.sub = 5, .type = DataType::unsigned16, .initial = Literal::number(tpdo.timer_ms)});
  b.object(0x1A00, od::ObjectCode::record, "Mapping 1");
  b.sub(0x1A00, {.sub = 0, .type = DataType::unsigned8, .initial = Literal::number(2)});
  b.sub(0x1A00, {.sub = 1, .type = DataType::unsigned32, .initial = Literal::number(0x2000'0010)});
  b.sub(0x1A00, {.sub = 2, .type = DataType::unsigned32, .initial = Literal::number(0x2001'0008)});
  return b.build();
}

design::Machine one_bus() {
  design::Machine m;
  m.file = "machine.toml";
  m.buses.emplace_back();
  m.buses.back().name = "line";
  m.buses.back().bitrate = 250'000;
  return m;
}

void add_slot(design::Machine& m, const std::string& name, unsigned id, std::shared_ptr<const od::Description> d,
              const std::string& bus = "line") {
  design::Slot slot;
  slot.spec.name = {"m", bus, name};
  slot.spec.id = NodeId(static_cast<std::uint8_t>(id));
  slot.description = std::move(d);
  m.slots.push_back(std::move(slot));
}

const analysis::Message* find(const BusMessages& found, const std::string& name, std::uint32_t key) {
  const auto it =
      std::ranges::find_if(found.line.messages, [&](const auto& m) { return m.name == name && m.key == key; });
  return it == found.line.messages.end() ? nullptr : &*it;
}

rt::Duration period_of(const Tpdo& tpdo, std::uint32_t sync_us = 0) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with(tpdo, sync_us));
  const auto found = messages_of(m, m.buses[0], {});
  const auto* const message = find(found, "TPDO 1", tpdo.cob_id + 5);
  return message == nullptr ? rt::Duration{-1} : message->period;
}

TEST(BusMessages, ATpdosPeriodIsWhatItsParametersSay) {
  EXPECT_EQ(period_of({.inhibit_100us = 25, .timer_ms = 100}), 2500us) << "not more often than the inhibit time";
  EXPECT_EQ(period_of({.timer_ms = 100}), 0ms) << "a change may come at any time";
  EXPECT_EQ(period_of({}), 0ms);
  EXPECT_EQ(period_of({.type = 4, .inhibit_100us = 25}, 20'000), 80ms) << "each fourth SYNC";
  EXPECT_EQ(period_of({.type = 0}, 20'000), 20ms) << "acyclic: at a SYNC";
  EXPECT_EQ(period_of({.type = 1}), -1ns) << "no SYNC, no PDO";
  EXPECT_EQ(period_of({.type = 253}), -1ns) << "on request only";
  EXPECT_EQ(period_of({.timer_ms = 9, .cob_id = 0x8000'0180}), -1ns) << "bit 31: it does not exist";
}

// `[bus.NAME.sync]`: Berth's own SYNC is on the bus, and what waits for SYNC has it.
TEST(BusMessages, BerthsOwnSync) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.type = 2}));
  m.buses[0].sync = design::BusSync{20ms, 10};
  const auto found = messages_of(m, m.buses[0], {});
  const auto* const sync = find(found, "SYNC", 0x80);
  ASSERT_NE(sync, nullptr);
  EXPECT_EQ(sync->period, 20ms);
  EXPECT_EQ(sync->data_bytes, 1U) << "it counts";
  EXPECT_EQ(found.line.senders[sync->sender].name, "master");
  ASSERT_NE(find(found, "TPDO 1", 0x185), nullptr);
  EXPECT_EQ(find(found, "TPDO 1", 0x185)->period, 40ms) << "each second SYNC";
  EXPECT_EQ(find(found, "TPDO 1", 0x185)->after, 0x80U) << "SYNC's wait is its jitter";
  EXPECT_EQ(find(found, "TPDO 1", 0x185)->deadline, 0ms) << "no link: no deadline";
  EXPECT_EQ(sync->deadline, 0ms);
  for (const auto& note : found.notes)
    EXPECT_NE(note.message.find("in which order"), std::string::npos) << note.message;
}

// A simulated port sends in order; what a real controller does with the frames that it holds is not known.
TEST(BusMessages, BerthsOwnQueue) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.inhibit_100us = 10}));
  const auto queue = [&] {
    const auto found = messages_of(m, m.buses[0], {});
    return std::ranges::find(found.line.senders, "master", &analysis::Sender::name)->queue;
  };
  const auto tells = [&] {
    const auto found = messages_of(m, m.buses[0], {});
    return std::ranges::any_of(found.notes, [](const auto& n) { return n.message.starts_with("Berth's own frames"); });
  };
  EXPECT_EQ(queue(), analysis::Queue::in_order);
  EXPECT_FALSE(tells());
  m.buses[0].port = {can::PortKind::socketcan, "can0"};
  EXPECT_EQ(queue(), analysis::Queue::unknown);
  EXPECT_TRUE(tells());
}

TEST(BusMessages, ASlotSaysTheQueueOfItsDevice) {
  auto m = one_bus();
  add_slot(m, "left", 5, nullptr);
  add_slot(m, "right", 6, nullptr);
  m.slots[0].queue = design::SendOrder::priority;
  const auto found = messages_of(m, m.buses[0], {});
  EXPECT_EQ(found.line.senders[0].queue, analysis::Queue::priority);
  EXPECT_EQ(found.line.senders[1].queue, analysis::Queue::unknown);
  const auto said = std::ranges::find_if(
      found.notes, [](const auto& n) { return n.message.find("in which order a device sends") != std::string::npos; });
  ASSERT_NE(said, found.notes.end());
  EXPECT_TRUE(said->message.ends_with(": right")) << said->message;
}

TEST(BusMessages, TwoProducersOfSyncAreNamed) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.type = 2}, 10'000));
  m.buses[0].sync = design::BusSync{20ms, 0};
  const auto found = messages_of(m, m.buses[0], {});
  ASSERT_FALSE(found.notes.empty());
  EXPECT_NE(to_string(found.notes[0]).find("master and left both produce SYNC"), std::string::npos)
      << to_string(found.notes[0]);
}

TEST(BusMessages, WhatANetworkHasBesidePdos) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.inhibit_100us = 500}, 10'000));
  add_slot(m, "right", 6, nullptr);
  add_slot(m, "elsewhere", 7, nullptr, "other");
  const auto found = messages_of(m, m.buses[0], {.fifo = {"right"}});
  ASSERT_EQ(analysis::wrong(found.line), "");
  EXPECT_EQ(found.line.senders.size(), 3U) << "two slots and the master";
  EXPECT_EQ(found.line.senders[0].queue, analysis::Queue::unknown);
  EXPECT_EQ(found.line.senders[1].queue, analysis::Queue::in_order);
  for (const std::uint32_t key : {0x705U, 0x706U, 0x77FU}) EXPECT_NE(find(found, "heartbeat", key), nullptr) << key;
  for (const std::uint32_t key : {0x85U, 0x86U}) EXPECT_NE(find(found, "EMCY", key), nullptr) << key;
  EXPECT_EQ(find(found, "heartbeat", 0x707), nullptr) << "of the other bus";
  ASSERT_NE(find(found, "SYNC", 0x80), nullptr);
  EXPECT_EQ(find(found, "SYNC", 0x80)->period, 10ms);
  EXPECT_EQ(find(found, "SYNC", 0x80)->data_bytes, 0U);
  ASSERT_NE(find(found, "TPDO 1", 0x185), nullptr);
  EXPECT_EQ(find(found, "TPDO 1", 0x185)->data_bytes, 3U);
  EXPECT_NE(find(found, "NMT", 0), nullptr);
  EXPECT_TRUE(std::ranges::is_sorted(found.line.messages, {}, &analysis::Message::key));
  EXPECT_TRUE(analysis::analyze(found.line).good());
  ASSERT_EQ(found.notes.size(), 2U);
  EXPECT_NE(to_string(found.notes[0]).find("1 of 2 slots have no description"), std::string::npos);
  EXPECT_NE(to_string(found.notes[1]).find("in which order a device sends its frames"), std::string::npos);
  m.buses[0].role = design::Role::observer;
  const auto observed = messages_of(m, m.buses[0], {});
  EXPECT_EQ(find(observed, "NMT", 0), nullptr) << "an observer sends nothing";
  EXPECT_EQ(find(observed, "SDO request", 0x605), nullptr);
}

TEST(BusMessages, ALinksDeadlineIsItsMessages) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.timer_ms = 50}));
  m.links.push_back({.from = {"left", "State"}, .to = {{"right", "6000h"}}, .deadline = 4ms, .place = {7, 1}});
  m.links.push_back({.from = {"left", "2000h:00"}, .to = {{"right", "6001h"}}, .deadline = 9ms, .place = {8, 1}});
  m.links.push_back({.from = {"left", "1018h:04"}, .to = {{"right", "6001h"}}, .deadline = 9ms, .place = {9, 1}});
  const auto found = messages_of(m, m.buses[0], {});
  ASSERT_NE(find(found, "TPDO 1", 0x185), nullptr);
  EXPECT_EQ(find(found, "TPDO 1", 0x185)->deadline, 4ms) << "the shortest";
  ASSERT_FALSE(found.notes.empty());
  EXPECT_EQ(found.notes.back().line, 9) << "no PDO carries that one";
  EXPECT_EQ(found.notes.back().severity, Finding::Severity::warning);
}

/// From the change to its arrival, 2 frames on the bus at most 2 ms long together.
analysis::Message linked_by(const Tpdo& tpdo, std::uint32_t sync_us = 0) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with(tpdo, sync_us));
  m.links.push_back({.from = {"left", "2000h"}, .to = {{"right", "6000h"}}, .deadline = 70ms, .place = {7, 1}});
  const auto found = messages_of(m, m.buses[0], {});
  const auto* const message = find(found, "TPDO 1", tpdo.cob_id + 5);
  return message == nullptr ? analysis::Message{} : *message;
}

// A link's deadline is from the change to its arrival (docs/linking.md): what the TPDO waits for is in its bound.
TEST(BusMessages, WhatATpdoWaitsForIsInItsLinksBound) {
  EXPECT_EQ(linked_by({.inhibit_100us = 25}).before, 2500us);
  EXPECT_EQ(linked_by({.inhibit_100us = 25}).deadline, 70ms);
  EXPECT_EQ(linked_by({.inhibit_100us = 25}).counts_every, 0ms);
  EXPECT_EQ(linked_by({.type = 3}, 20'000).before, 60ms) << "sent at each third SYNC";
  EXPECT_EQ(linked_by({.type = 3}, 20'000).counts_every, 20ms) << "used at the next";
  EXPECT_EQ(linked_by({.type = 3}, 20'000).deadline, 70ms);
}

}  // namespace
}  // namespace berth::traffic
