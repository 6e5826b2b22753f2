// Objects 1010h, 1011h and 1020h of a whole device, over SDO: what is stored, when it counts, and what a power loss in
// the middle leaves (docs/protocols/cia301.md §Stored parameters).
#include <gtest/gtest.h>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::device::test::storage_tests {
namespace {

using od::AbortCode;
using od::DataType;
using od::Literal;

constexpr std::uint32_t save = 0x65766173;
constexpr std::uint32_t load = 0x64616F6C;

constexpr std::uint8_t many = 60;

Options node9() { return {.address = address_of(5), .node_id = NodeId(9), .bit_rate = 500'000}; }

std::shared_ptr<const od::Description> description(bool manufacturer = true) {
  od::DescriptionBuilder b;
  add_device(b);
  add_storage(b);
  if (!manufacturer) {
    for (const std::uint16_t index : {std::uint16_t{0x1010}, std::uint16_t{0x1011}}) {
      b.object(index, od::ObjectCode::array, "Store");
    }
  }
  b.variable(0x2000, {.type = DataType::unsigned16, .initial = Literal::number(20)});
  b.variable(0x6000, {.type = DataType::unsigned8, .initial = Literal::number(60)});
  b.variable(0x6200, {.type = DataType::unsigned8, .access = od::Access::rww, .mappable = true});
  b.object(0x2100, od::ObjectCode::array, "More than one write to memory takes");
  for (std::uint8_t i = 1; i <= many; ++i) b.sub(0x2100, {.sub = i, .initial = Literal::number(0)});
  return b.build();
}

struct Site {
  explicit Site(const Timing& timing = {}, rt::Duration store_time = milliseconds(1), Options options = node9())
      : node(rig.world, rig.bus, std::move(options), timing, store_time, description()) {
    node.on();
    rig.run(milliseconds(20));
  }
  std::uint32_t get(std::uint16_t index, std::uint8_t sub = 0) {
    return node.device.values().get_or<std::uint32_t>({index, sub}, 0xFFFF'FFFF);
  }
  /// 1017h, 2000h and 6000h.
  void set(std::uint32_t heartbeat, std::uint32_t manufacturer, std::uint32_t application) {
    EXPECT_EQ(rig.write(0x1017, 0, 2, heartbeat), Rig::done(0x1017, 0));
    EXPECT_EQ(rig.write(0x2000, 0, 2, manufacturer), Rig::done(0x2000, 0));
    EXPECT_EQ(rig.write(0x6000, 0, 1, application), Rig::done(0x6000, 0));
  }
  std::vector<std::uint32_t> all() { return {get(0x1017), get(0x2000), get(0x6000)}; }
  void power_cycle() {
    node.off();
    node.on();
    rig.run(milliseconds(20));
  }
  /// All of 2100h, by the device's own application.
  void set_many(std::uint32_t value) {
    for (std::uint8_t i = 1; i <= many; ++i) node.device.values().set({0x2100, i}, value);
  }
  /// Their one value; empty when they differ.
  std::optional<std::uint32_t> get_many() {
    for (std::uint8_t i = 2; i <= many; ++i) {
      if (get(0x2100, i) != get(0x2100, 1)) return std::nullopt;
    }
    return get(0x2100, 1);
  }
  Rig rig;
  Node node;
};
using Three = std::vector<std::uint32_t>;

// A9.1, OD.1010: the signature "save" stores, any other value is 0800 0020; reading says "on command" (bit 0).
TEST(Storage, A9_1_OD_1010_SaveStoresOverPower) {
  Site s;
  EXPECT_EQ(s.rig.read(0x1010, 0), Rig::value(0x1010, 0, 1, 4));
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    EXPECT_EQ(s.rig.read(0x1010, sub), Rig::value(0x1010, sub, 4, 1));
    for (const std::uint32_t wrong : {0U, 1U, load, 0x73617665U}) {
      EXPECT_EQ(s.rig.write(0x1010, sub, 4, wrong), Rig::refused(0x1010, sub, AbortCode::not_stored));
    }
  }
  EXPECT_EQ(s.rig.write(0x1010, 5, 4, save), Rig::refused(0x1010, 5, AbortCode::no_sub_index));
  EXPECT_EQ(s.rig.write(0x1010, 1, 2, 0x6173), Rig::refused(0x1010, 1, AbortCode::length_too_low));
  s.set(700, 21, 61);
  s.power_cycle();
  EXPECT_EQ(s.all(), (Three{0, 20, 60})) << "not stored yet";
  s.set(700, 21, 61);
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(30)), Rig::done(0x1010, 1));
  s.set(800, 22, 62);
  EXPECT_EQ(s.rig.read(0x1010, 1), Rig::value(0x1010, 1, 4, 1)) << "not the signature that was written";
  s.power_cycle();
  EXPECT_EQ(s.all(), (Three{700, 21, 61}));
  EXPECT_EQ(s.rig.write(0x6200, 0, 1, 5), Rig::done(0x6200, 0));
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(30)), Rig::done(0x1010, 1));
  s.power_cycle();
  EXPECT_EQ(s.get(0x6200), 0U) << "an output does not come back by itself";
}

TEST(Storage, A9_1_GroupsOverSdo) {
  const std::map<std::uint8_t, Three> expected{{2, {700, 20, 60}}, {3, {0, 20, 61}}, {4, {0, 21, 60}}};
  for (const auto& [sub, values] : expected) {
    Site s;
    s.set(700, 21, 61);
    EXPECT_EQ(s.rig.write(0x1010, sub, 4, save, milliseconds(30)), Rig::done(0x1010, sub));
    s.power_cycle();
    EXPECT_EQ(s.all(), values) << "sub-index " << int{sub};
  }
}

// A3.4, HC2.8: reset communication brings back 1000h..1FFFh as stored, reset node everything as stored.
TEST(Storage, A3_4_HC2_8_ResetsBringBackTheStoredValuesOfTheirRange) {
  Site s;
  s.set(700, 21, 61);
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(30)), Rig::done(0x1010, 1));
  s.set(800, 22, 62);
  s.rig.ask("000#8209", milliseconds(20));
  EXPECT_EQ(s.all(), (Three{700, 22, 62}));
  s.set(800, 22, 62);
  s.rig.ask("000#8109", milliseconds(20));
  EXPECT_EQ(s.all(), (Three{700, 21, 61}));
  EXPECT_EQ(s.rig.record.count("709#00"), 3U);
  s.rig.record.clear();
  s.rig.run(milliseconds(1500));
  EXPECT_EQ(s.rig.record.count("709#7F"), 2U) << "the stored heartbeat time is in use";
}

// A9.2, OD.1011: "load" restores the defaults; they count after the next reset, for sub-index 2 reset communication is
// enough.
TEST(Storage, A9_2_OD_1011_LoadCountsFromTheNextReset) {
  Site s;
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    EXPECT_EQ(s.rig.read(0x1011, sub), Rig::value(0x1011, sub, 4, 1));
    for (const std::uint32_t wrong : {0U, 1U, save, 0x6C6F6164U}) {
      EXPECT_EQ(s.rig.write(0x1011, sub, 4, wrong), Rig::refused(0x1011, sub, AbortCode::not_stored));
    }
  }
  const auto store = [&] {
    s.set(700, 21, 61);
    EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(30)), Rig::done(0x1010, 1));
  };
  store();
  EXPECT_EQ(s.rig.write(0x1011, 2, 4, load, milliseconds(30)), Rig::done(0x1011, 2));
  EXPECT_EQ(s.all(), (Three{700, 21, 61})) << "not before a reset";
  s.rig.ask("000#8209", milliseconds(20));
  EXPECT_EQ(s.all(), (Three{0, 21, 61}));
  s.rig.ask("000#8109", milliseconds(20));
  EXPECT_EQ(s.all(), (Three{0, 21, 61}));
  store();
  EXPECT_EQ(s.rig.write(0x1011, 1, 4, load, milliseconds(30)), Rig::done(0x1011, 1));
  s.rig.ask("000#8109", milliseconds(20));
  EXPECT_EQ(s.all(), (Three{0, 20, 60}));
  store();
  EXPECT_EQ(s.rig.write(0x1011, 4, 4, load, milliseconds(30)), Rig::done(0x1011, 4));
  s.power_cycle();
  EXPECT_EQ(s.all(), (Three{700, 20, 61}));
}

// A9.3, OD.1020: date and time of the configuration are stored with it, and a write that changes a stored value takes
// them away; process data, the same value, and the two themselves do not.
TEST(Storage, A9_3_OD_1020_AChangeTakesTheVerificationAway) {
  Site s;
  const auto dates = [&] { return Three{s.get(0x1020, 1), s.get(0x1020, 2)}; };
  const auto date = [&] {
    EXPECT_EQ(s.rig.write(0x1020, 1, 4, 15000), Rig::done(0x1020, 1));
    EXPECT_EQ(s.rig.write(0x1020, 2, 4, 4711), Rig::done(0x1020, 2));
    EXPECT_EQ(dates(), (Three{15000, 4711}));
  };
  s.set(700, 21, 61);
  date();
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(30)), Rig::done(0x1010, 1));
  EXPECT_EQ(dates(), (Three{15000, 4711})) << "1010h is a command";
  s.power_cycle();
  EXPECT_EQ(dates(), (Three{15000, 4711}));
  EXPECT_EQ(s.rig.write(0x2000, 0, 2, 21), Rig::done(0x2000, 0)) << "the same value";
  EXPECT_EQ(s.rig.write(0x6200, 0, 1, 5), Rig::done(0x6200, 0)) << "process data";
  EXPECT_EQ(s.rig.write(0x1003, 0, 1, 0), Rig::done(0x1003, 0)) << "a history";
  EXPECT_EQ(s.rig.write(0x1016, 1, 4, 0xFF000000), Rig::refused(0x1016, 1, AbortCode::invalid_value));
  EXPECT_EQ(dates(), (Three{15000, 4711}));
  EXPECT_EQ(s.rig.write(0x2000, 0, 2, 22), Rig::done(0x2000, 0));
  EXPECT_EQ(dates(), (Three{0, 0}));
  EXPECT_EQ(s.rig.read(0x1020, 1), Rig::value(0x1020, 1, 4, 0));
  date();
  EXPECT_EQ(s.rig.write(0x1017, 0, 2, 701), Rig::done(0x1017, 0));
  EXPECT_EQ(dates(), (Three{0, 0}));
  s.power_cycle();
  EXPECT_EQ(dates(), (Three{15000, 4711})) << "of the stored configuration, which is back";
}

// Without memory, or with one that has no room, nothing is promised: 0 when read, 0800 0020 when written.
TEST(Storage, WithoutMemoryStoringIsRefused) {
  Rig rig;
  auto controller = rig.bus.attach();
  can::Dispatcher dispatcher(rig.world.executor(), *controller);
  SimFlash small(rig.world.executor(), 64, milliseconds(0));
  for (NvMemory* memory : {static_cast<NvMemory*>(nullptr), static_cast<NvMemory*>(&small)}) {
    Device device(dispatcher, description(), memory, node9());
    device.power_on();
    rig.run(milliseconds(1));
    for (const std::uint16_t index : {std::uint16_t{0x1010}, std::uint16_t{0x1011}}) {
      EXPECT_EQ(rig.read(index, 1), Rig::value(index, 1, 4, 0));
      EXPECT_EQ(rig.write(index, 1, 4, index == 0x1010 ? save : load), Rig::refused(index, 1, AbortCode::not_stored));
    }
  }
}

// The answer to "save" comes when everything is in memory, not before; 0606 0000 when the medium fails.
TEST(Storage, TheAnswerComesWhenItIsStored) {
  Site s({}, milliseconds(40));
  s.set(700, 21, 61);
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(39)), "");
  EXPECT_TRUE(s.node.device.stored().storing());
  s.rig.run(milliseconds(41 * 3));
  EXPECT_EQ(s.rig.record.text.back(), Rig::done(0x1010, 1));
  EXPECT_FALSE(s.node.device.stored().storing());
  s.node.flash.broken(true);
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(200)), Rig::refused(0x1010, 1, AbortCode::hardware));
  EXPECT_EQ(s.rig.write(0x1011, 1, 4, load, milliseconds(200)), Rig::refused(0x1011, 1, AbortCode::hardware));
  s.node.flash.broken(false);
  s.power_cycle();
  EXPECT_EQ(s.all(), (Three{700, 21, 61}));
}

TEST(Storage, ADeviceMayBeDeafMeanwhile) {
  for (const bool deaf : {false, true}) {
    Site s({.deaf_while_storing = deaf}, milliseconds(40));
    s.set(700, 21, 61);
    s.rig.record.clear();
    s.rig.send("609#2310100173617665");
    s.rig.run(milliseconds(10));
    s.rig.ask("709#R1");
    EXPECT_EQ(s.rig.record.count("709#7F"), deaf ? 0U : 0U) << "heartbeat excludes guarding";
    s.rig.ask("7E5#4C00000000000000");
    s.rig.ask("7E5#5E00000000000000");
    s.rig.ask("000#0109");
    EXPECT_EQ(s.node.device.state(), deaf ? NmtState::pre_operational : NmtState::operational);
    s.rig.run(milliseconds(200));
    s.rig.ask("000#0109");
    EXPECT_EQ(s.node.device.state(), NmtState::operational) << "hears again";
    EXPECT_EQ(s.rig.record.count(Rig::done(0x1010, 1)), 1U);
    s.rig.send("609#2310100173617665");
    s.rig.run(milliseconds(10));
    s.node.device.apply(co::NmtCommand::reset_communication);  // its own firmware says so
    s.rig.run(milliseconds(1));
    s.rig.ask("000#0109");
    EXPECT_EQ(s.node.device.state(), NmtState::operational) << "not deaf for ever";
  }
}

// LSS and 1010h share one memory; one write at a time, and neither harms the other's record.
TEST(Storage, LssAndParametersShareOneMemory) {
  Site s({}, milliseconds(10));
  s.set(700, 21, 61);
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(100)), Rig::done(0x1010, 1));
  s.rig.give_id(address_of(5), 9);
  s.rig.send("7E5#1700000000000000");
  s.rig.run(milliseconds(2));
  EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(3)), Rig::refused(0x1010, 1, AbortCode::device_state));
  s.rig.run(milliseconds(20));
  EXPECT_EQ(s.rig.record.count("7E4#1700000000000000"), 1U);
  s.set(800, 22, 62);
  s.rig.send("609#2310100173617665");
  s.rig.run(milliseconds(5));
  s.rig.ask("7E5#1700000000000000");
  EXPECT_EQ(s.rig.record.count("7E4#1702000000000000"), 1U) << "storage error: the memory is busy";
  s.rig.run(milliseconds(100));
  s.power_cycle();
  EXPECT_EQ(s.all(), (Three{800, 22, 62}));
  EXPECT_EQ(s.node.device.node_id(), NodeId(9));
}

// A reset in the middle of a save: the old parameters or the new ones, never a mixture with those of after the reset,
// and the next save works.
TEST(Storage, ResetInTheMiddleOfASave) {
  int new_seen = 0;
  for (const char* reset : {"000#8109", "000#8209"}) {
    for (int at = 0; at <= 60; at += 2) {
      Site s({}, milliseconds(10));
      s.set(700, 21, 61);
      s.set_many(1);
      EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(90)), Rig::done(0x1010, 1));
      s.set(800, 22, 62);
      s.set_many(2);
      s.rig.send("609#2310100173617665");
      s.rig.run(milliseconds(at));
      s.rig.ask(reset, milliseconds(100));
      EXPECT_FALSE(s.node.device.stored().storing());
      s.power_cycle();
      const bool is_new = s.get(0x1017) == 800;
      new_seen += is_new ? 1 : 0;
      EXPECT_EQ(s.all(), is_new ? (Three{800, 22, 62}) : (Three{700, 21, 61})) << at;
      EXPECT_EQ(s.get_many(), is_new ? 2U : 1U) << at;
      s.set(900, 23, 63);
      s.set_many(3);
      EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(90)), Rig::done(0x1010, 1));
      s.power_cycle();
      EXPECT_EQ(s.all(), (Three{900, 23, 63}));
      EXPECT_EQ(s.get_many(), 3U);
    }
  }
  EXPECT_GT(new_seen, 4);
}

// A power loss at any byte of a save over SDO.
TEST(Storage, PowerLossAtAnyByteOfASave) {
  struct Cutter final : SimFlash::Watcher {
    void write_began() noexcept override {}
    void write_ended() noexcept override {}
    void cut() noexcept override { node->off(); }
    Node* node = nullptr;
  };
  int old_seen = 0;
  int new_seen = 0;
  for (std::uint64_t cut = 0; new_seen == 0; ++cut) {
    Site s;
    s.set(700, 21, 61);
    EXPECT_EQ(s.rig.write(0x1010, 1, 4, save, milliseconds(60)), Rig::done(0x1010, 1));
    s.set(800, 22, 62);
    s.set_many(2);
    Cutter cutter;
    cutter.node = &s.node;
    s.node.flash.watch(&cutter);
    s.node.flash.cut_after(cut, static_cast<int>(cut * 37 % 256));
    const auto answer = s.rig.write(0x1010, 1, 4, save, milliseconds(20));
    s.node.flash.never_cut();
    s.node.on();
    s.rig.run(milliseconds(20));
    ASSERT_TRUE(s.all() == (Three{700, 21, 61}) || s.all() == (Three{800, 22, 62})) << "cut after " << cut;
    EXPECT_EQ(s.get_many(), (s.all() == Three{800, 22, 62} ? 2U : 0U)) << "cut after " << cut;
    (s.all() == Three{800, 22, 62} ? new_seen : old_seen) += 1;
    EXPECT_EQ(answer == Rig::done(0x1010, 1), new_seen > 0) << "confirmed is stored, not confirmed is not";
    s.node.flash.watch(nullptr);
    ASSERT_LT(cut, 2000U);
  }
  EXPECT_GT(old_seen, 40);
}

// The whole memory of a device outlives it in a plant's state: what was restored is used.
TEST(Storage, AnImageMovesToAnotherDevice) {
  Site a;
  a.set(700, 21, 61);
  EXPECT_EQ(a.rig.write(0x1010, 1, 4, save, milliseconds(60)), Rig::done(0x1010, 1));
  Site b;
  b.node.off();
  b.node.flash.restore(a.node.flash.image());
  b.node.on();
  b.rig.run(milliseconds(20));
  EXPECT_EQ(b.all(), (Three{700, 21, 61}));
}

// S4.2: a node-ID of switches counts more than one that LSS stored before they were set: one memory, read by both
// kinds.
TEST(Storage, S4_2_SwitchesCountMoreThanTheMemory) {
  Rig rig;
  Node first(rig.world, rig.bus, {.address = address_of(5)}, {}, milliseconds(5));
  first.on();
  rig.run(milliseconds(10));
  rig.give_id(address_of(5), 0x31);
  rig.ask("7E5#1700000000000000", milliseconds(50));
  rig.ask("7E5#0400000000000000", milliseconds(50));
  ASSERT_EQ(first.device.node_id(), NodeId(0x31));
  first.off();
  for (const auto& [source, id] : {std::pair(NodeIdSource::nonvolatile, 0x31), std::pair(NodeIdSource::fixed, 0x44)}) {
    Node again(rig.world, rig.bus, {.address = address_of(5), .source = source, .node_id = NodeId(0x44)});
    again.flash.restore(first.flash.image());
    again.on();
    rig.run(milliseconds(20));
    EXPECT_EQ(again.device.node_id().value(), id);
    again.off();
  }
}

}  // namespace
}  // namespace berth::device::test::storage_tests
