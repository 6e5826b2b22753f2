// What the files of a machine say of a bus's messages.
#include "berth/command/bus_messages.hpp"

#include <algorithm>

#include "berth/od/description.hpp"
#include "tests/pch.hpp"

namespace berth::command {
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
  EXPECT_EQ(period_of({.timer_ms = 100}), 100ms);
  EXPECT_EQ(period_of({}), 10ms) << "assumed";
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
  EXPECT_TRUE(found.notes.empty());
}

TEST(BusMessages, TwoProducersOfSyncAreNamed) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.type = 2}, 10'000));
  m.buses[0].sync = design::BusSync{20ms, 0};
  const auto found = messages_of(m, m.buses[0], {});
  ASSERT_EQ(found.notes.size(), 1U);
  EXPECT_NE(to_string(found.notes[0]).find("master and left both produce SYNC"), std::string::npos)
      << to_string(found.notes[0]);
}

TEST(BusMessages, WhatANetworkHasBesidePdos) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with({.timer_ms = 50}, 10'000));
  add_slot(m, "right", 6, nullptr);
  add_slot(m, "elsewhere", 7, nullptr, "other");
  const auto found = messages_of(m, m.buses[0], {.fifo = {"right"}});
  ASSERT_EQ(analysis::wrong(found.line), "");
  EXPECT_EQ(found.line.senders.size(), 3U) << "two slots and the master";
  EXPECT_FALSE(found.line.senders[0].fifo);
  EXPECT_TRUE(found.line.senders[1].fifo);
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
  EXPECT_NE(to_string(found.notes[1]).find("1 TPDOs have an event timer and no inhibit time"), std::string::npos);
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
  EXPECT_EQ(find(found, "TPDO 1", 0x185)->deadline, 4ms);
  ASSERT_FALSE(found.notes.empty());
  EXPECT_EQ(found.notes.back().line, 9) << "no PDO carries that one";
  EXPECT_EQ(found.notes.back().severity, Finding::Severity::warning);
}

rt::Duration linked_within(const Tpdo& tpdo, rt::Duration deadline, std::uint32_t sync_us = 0) {
  auto m = one_bus();
  add_slot(m, "left", 5, device_with(tpdo, sync_us));
  m.links.push_back({.from = {"left", "2000h"}, .to = {{"right", "6000h"}}, .deadline = deadline, .place = {7, 1}});
  const auto found = messages_of(m, m.buses[0], {});
  const auto* const message = find(found, "TPDO 1", tpdo.cob_id + 5);
  return message == nullptr ? rt::Duration{-1} : message->deadline;
}

// A link's deadline is from the change to its arrival (docs/linking.md): what the TPDO waits for is not the bus's.
TEST(BusMessages, WhatATpdoWaitsForIsTakenOffItsLinksDeadline) {
  EXPECT_EQ(linked_within({.inhibit_100us = 25}, 4ms), 1500us);
  EXPECT_EQ(linked_within({.inhibit_100us = 40}, 4ms), 1ns) << "no frame is so quick";
  EXPECT_EQ(linked_within({.inhibit_100us = 50}, 4ms), 1ns);
  EXPECT_EQ(linked_within({.type = 1}, 40ms, 20'000), 20ms) << "sent at one SYNC, used at the next";
  EXPECT_EQ(linked_within({.type = 1}, 39ms, 20'000), 1ns);
  EXPECT_EQ(linked_within({.type = 3}, 80ms, 20'000), 20ms) << "sent at each third SYNC";
}

}  // namespace
}  // namespace berth::command
