// PDOs of a remote node by the names of its objects.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/base/random.hpp"
#include "rig.hpp"

namespace berth::client::test {
namespace {

using od::DataType;

std::shared_ptr<Tpdo> subscribed(Rig& rig, unsigned number) {
  const auto pdo = rig.get(rig.node->subscribe(number));
  EXPECT_TRUE(pdo.has_value()) << (pdo ? "" : pdo.error().message);
  return pdo.value_or(nullptr);
}

void set(Rig& rig, ObjectRef ref, std::int64_t value) {
  ASSERT_EQ(rig.device->device.values().set(ref, value), od::AbortCode::none);
}

TEST(ClientPdo, ValuesByNameAsTheDeviceMapsThem) {
  Rig rig;
  const auto pdo = subscribed(rig, 1);
  EXPECT_EQ(pdo->cob_id().id(), 0x185U);
  EXPECT_EQ(pdo->layout().bits, 57U);
  std::vector<std::int32_t> told;
  pdo->on_pdo([&](const PdoSample& s) { told.push_back(s.get<std::int32_t>("Axis.Position").value_or(0)); });
  set(rig, {0x2104, 1}, -100000);
  set(rig, {0x2010, 0}, -8388607);
  rig.device->device.values().set<bool>({0x2001, 0}, true);
  rig.start();
  const auto sample = rig.get(pdo->next(rt::never));
  ASSERT_TRUE(sample.has_value());
  EXPECT_EQ(sample->get<std::int32_t>("Axis.Position"), -100000);
  EXPECT_EQ(sample->get<std::int64_t>("2104h:01"), -100000);
  EXPECT_EQ(sample->get<bool>("BOOLEAN"), true);
  EXPECT_EQ(sample->get<std::int32_t>("INTEGER24"), -8388607) << "24 bits that begin at bit 33";
  EXPECT_EQ(told, std::vector<std::int32_t>{-100000});
  EXPECT_EQ(pdo->newest()->get<bool>("BOOLEAN"), true);
  EXPECT_EQ(sample->get<std::int16_t>("Axis.Position").error().code, Errc::invalid);
  EXPECT_NE(sample->get<std::int16_t>("Axis.Position").error().message.find("use std::int32_t"), std::string::npos);
  EXPECT_EQ(sample->get<std::int16_t>("Axis.Speed").error().message,
            "node 5, object 2104h:02 \"Axis/Speed\": the PDO does not map the object");
  EXPECT_EQ(sample->get<std::int32_t>("Position").error().code, Errc::duplicate);
}

// A remapped device: what is read from it counts, not the description.
TEST(ClientPdo, TheDevicesMappingOrTheDescriptions) {
  Rig rig;
  for (const auto& [ref, value] : std::vector<std::pair<ObjectRef, std::uint32_t>>{{{0x1801, 1}, 0x80000285},
                                                                                   {{0x1A01, 0}, 0},
                                                                                   {{0x1A01, 1}, 0x21050208},
                                                                                   {{0x1A01, 0}, 1},
                                                                                   {{0x1801, 1}, 0x345}}) {
    const auto done = rig.get(rig.node->write(ref, value));
    ASSERT_TRUE(done.has_value()) << done.error().message;
  }
  const auto read = subscribed(rig, 2);
  EXPECT_EQ(read->cob_id().id(), 0x345U);
  ASSERT_EQ(read->layout().fields.size(), 1U);
  EXPECT_EQ(read->layout().fields[0].object, (ObjectRef{0x2105, 2}));
  const auto described = rig.node->subscribe_as_described(2);
  ASSERT_TRUE(described.has_value());
  EXPECT_EQ((*described)->cob_id().id(), 0x285U);
  EXPECT_EQ((*described)->layout().fields[0].object, (ObjectRef{0x2104, 2}));
  EXPECT_EQ(rig.get(read->next(rt::never)).error().code, Errc::cancelled) << "the second replaces the first";
}

TEST(ClientPdo, WhatCannotBeSubscribed) {
  Rig rig;
  const auto code = [&](unsigned n) { return rig.get(rig.node->subscribe(n)).error(); };
  EXPECT_EQ(code(0).code, Errc::invalid);
  EXPECT_EQ(code(513).code, Errc::invalid);
  EXPECT_EQ(code(5).message, "node 5, object 1804h:01 \"" + rig.node->names().name({0x1804, 1}) +
                                 "\": the PDO is not valid: bit 31 of its COB-ID is set");
  EXPECT_EQ(code(9).code, Errc::aborted);
  EXPECT_EQ(code(9).detail, 0x06020000U);
  EXPECT_EQ(rig.node->subscribe_as_described(9).error().code, Errc::not_found);
  EXPECT_EQ(rig.node->subscribe_as_described(5).error().code, Errc::invalid);
  auto& values = rig.device->device.values();
  values.set<std::uint8_t>({0x1A00, 0}, 0xFE);
  EXPECT_EQ(code(1).code, Errc::unsupported);
  values.set<std::uint8_t>({0x1A00, 0}, 8);
  for (std::uint8_t sub = 1; sub <= 8; ++sub) values.set<std::uint32_t>({0x1A00, sub}, 0x21040120);
  EXPECT_EQ(code(1).code, Errc::mismatch) << "eight times 32 bits";
  values.set<std::uint8_t>({0x1A00, 0}, 1);
  values.set<std::uint32_t>({0x1800, 1}, 0x605);
  EXPECT_EQ(code(1).code, Errc::mismatch) << "an SDO's identifier: nobody may listen there as to a PDO";
}

TEST(ClientPdo, ShortLongRemoteAndForeignFrames) {
  Rig rig;
  const auto pdo = rig.node->subscribe_as_described(2).value();
  const auto send = [&](const char* frame) {
    rig.device->dispatcher.send(*can::parse_frame(frame));
    rig.run(1ms);
  };
  send("285#01");
  EXPECT_EQ(pdo->too_short(), 1U);
  send("285#R2");
  send("286#0200");
  send("00000285#0200");
  EXPECT_EQ(pdo->received(), 0U);
  send("285#0200");
  send("285#0300FFFF");
  EXPECT_EQ(pdo->received(), 2U);
  EXPECT_EQ(rig.get(pdo->next(rt::never))->get<std::int16_t>("Axis.Speed"), 2);
  EXPECT_EQ(rig.get(pdo->next(rt::never))->get<std::int16_t>("Axis.Speed"), 3);
  EXPECT_EQ(rig.get(pdo->next(rig.world.now())).error().code, Errc::timeout) << "a deadline that is now";
}

TEST(ClientPdo, TheNewestAreKept) {
  Rig rig;
  const auto pdo = rig.node->subscribe_as_described(2).value();
  for (unsigned i = 0; i < Tpdo::kept + 10; ++i) {
    const std::uint8_t low = static_cast<std::uint8_t>(i);
    rig.device->dispatcher.send(can::Frame::base(0x285, {low, 0}));
    rig.run(1ms);
  }
  EXPECT_EQ(pdo->dropped(), 10U);
  EXPECT_EQ(rig.get(pdo->next(rt::never))->get<std::int16_t>("Axis.Speed"), 10);
  pdo->clear();
  EXPECT_EQ(rig.get(pdo->next(rig.world.now() + 1ms)).error().code, Errc::timeout);
}

TEST(ClientPdo, ASampleAndAPdoOutliveTheNode) {
  Rig rig;
  const auto pdo = rig.node->subscribe_as_described(2).value();
  const auto out = rig.node->open_as_described(1).value();
  rig.device->dispatcher.send(can::Frame::base(0x285, {1, 2}));
  rig.run(1ms);
  const auto sample = *pdo->newest();
  rig.node.reset();
  rig.device->dispatcher.send(can::Frame::base(0x285, {3, 4}));
  rig.run(1ms);
  EXPECT_EQ(sample.get<std::int16_t>("Axis.Speed"), 0x201);
  EXPECT_EQ(pdo->received(), 1U);
  EXPECT_TRUE(rig.get(pdo->next(rt::never)).has_value()) << "what came before can still be taken";
  EXPECT_EQ(rig.get(pdo->next(rt::never)).error().code, Errc::cancelled);
  EXPECT_EQ(out->set("Axis.Speed", 1).error().code, Errc::cancelled);
  EXPECT_EQ(out->send().error().code, Errc::cancelled);
}

TEST(ClientPdo, UnsubscribedInTheCallback) {
  Rig rig;
  int called = 0;
  const auto pdo = rig.node->subscribe_as_described(2).value();
  pdo->on_pdo([&](const PdoSample&) {
    ++called;
    rig.node->unsubscribe(2);
  });
  for (int i = 0; i < 3; ++i) rig.device->dispatcher.send(can::Frame::base(0x285, {1, 2}));
  rig.run(5ms);
  EXPECT_EQ(called, 1);
  rig.node->unsubscribe(2);
  rig.node->unsubscribe(77);
}

TEST(ClientPdo, AnRpdoSetsTheDevicesValues) {
  Rig rig;
  const auto opened = rig.get(rig.node->open(1));
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const auto pdo = *opened;
  rig.start();
  EXPECT_TRUE(pdo->set("Axis.Speed", -300));
  EXPECT_TRUE(pdo->set("BOOLEAN", true));
  EXPECT_TRUE(pdo->send());
  rig.run(5ms);
  EXPECT_EQ(rig.bus.frames.back(), "205#09D4FE01") << "9: the torque's default";
  EXPECT_EQ(rig.device->value<std::int16_t>({0x2104, 2}), -300);
  EXPECT_EQ(rig.device->value<bool>({0x2001, 0}), true);
  EXPECT_TRUE(pdo->set("Axis.Speed", 300)) << "the old bits go";
  EXPECT_TRUE(pdo->send());
  rig.run(5ms);
  EXPECT_EQ(rig.bus.frames.back(), "205#092C0101");
  EXPECT_EQ(pdo->set("Axis.Speed", 40000).error().detail, 0x06090031U);
  EXPECT_EQ(pdo->set("Torque", -1).error().detail, 0x06090032U);
  EXPECT_EQ(pdo->set("Torque", "much").error().code, Errc::invalid);
  EXPECT_EQ(pdo->set("Axis.Position", 1).error().code, Errc::not_found);
  rig.bus.port->listen_only(true);
  EXPECT_EQ(pdo->send().error().code, Errc::bus);
  EXPECT_EQ(pdo->send().error().message, "node 5: the PDO did not leave: the port is listen-only");
}

// Any mapping of any lengths: the values of a sample are the bits at their places, taken out one by one.
RC_GTEST_PROP(ClientPdoProperty, BitsAtTheirPlaces, (std::uint64_t seed)) {
  Random random(seed);
  od::DescriptionBuilder b;
  std::vector<co::PdoEntry> entries;
  unsigned total = 0;
  while (entries.size() < 20) {
    const auto index = static_cast<std::uint16_t>(0x2000 + entries.size());
    const bool is_signed = random.chance(500'000);
    const auto bits = static_cast<std::uint8_t>(random.between(1, 64));
    if (total + bits > 64) break;
    const bool described = random.chance(800'000);
    if (described) b.variable(index, {.type = is_signed ? DataType::integer64 : DataType::unsigned64});
    entries.push_back({{index, 0}, bits});
    total += bits;
  }
  b.object(0x1800, od::ObjectCode::record, "c");
  b.sub(0x1800, {.sub = 1, .initial = od::Literal::number(0x181)});
  b.object(0x1A00, od::ObjectCode::record, "m");
  b.sub(0x1A00, {.sub = 0, .type = DataType::unsigned8, .initial = od::Literal::number(entries.size())});
  for (std::size_t i = 0; i < entries.size(); ++i) {
    b.sub(0x1A00, {.sub = static_cast<std::uint8_t>(i + 1), .initial = od::Literal::number(entries[i].raw())});
  }
  sim::World world;
  Bus bus(world);
  const auto sender = bus.bus.attach();
  Network network(bus.dispatcher);
  RemoteNode node(network, NodeId(1), b.build());
  const auto pdo = node.subscribe_as_described(1).value();
  std::array<std::uint8_t, 8> data{};
  for (auto& byte : data) byte = static_cast<std::uint8_t>(random.next());
  sender->send(can::Frame::base(0x181, data), 0);
  world.run_for(1ms);
  RC_ASSERT(pdo->newest().has_value());
  unsigned at = 0;
  for (const auto& entry : entries) {
    std::uint64_t expected = 0;
    for (unsigned i = 0; i < entry.bits; ++i, ++at) {
      expected |= static_cast<std::uint64_t>(data[at / 8] >> at % 8 & 1) << i;
    }
    const auto* object = node.description().find(entry.object.index);
    if (object != nullptr && od::is_signed(object->type)) {
      const bool negative = (expected >> (entry.bits - 1) & 1) != 0;
      if (negative && entry.bits < 64) expected |= ~std::uint64_t{0} << entry.bits;
      RC_ASSERT(pdo->newest()->get<std::int64_t>(entry.object) == static_cast<std::int64_t>(expected));
    } else {
      RC_ASSERT(pdo->newest()->get<std::uint64_t>(entry.object) == expected);
    }
  }
}

}  // namespace
}  // namespace berth::client::test
